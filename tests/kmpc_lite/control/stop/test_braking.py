"""Braking ramps: as fast as the limits allow, on the curve, to a stand."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import kmpc_lite as kl
from kmpc_lite.control.stop.braking import LONGEST_RAMP, Braking

DT = 0.1
MODEL = kl.nominal_unicycle(DT)
WEAK = kl.NavigationProblem(du_max=(0.5, 2.0))
ONE = kl.NavigationProblem(du_max=(np.inf, 2.0))


@given(
    v=st.floats(-0.6, 0.6),
    omega=st.floats(-0.78, 0.78),
    dt=st.floats(0.01, 1.0),
    limit_v=st.floats(0.1, 5.0),
    limit_w=st.floats(0.1, 9.0),
)
def test_ramp_ends_at_zero_within_the_limits_on_the_curve(
    v: float, omega: float, dt: float, limit_v: float, limit_w: float
) -> None:
    command, limits = np.array([v, omega]), np.array([limit_v, limit_w]) * dt
    problem = kl.NavigationProblem(dt=dt, deceleration=(limit_v, limit_w))
    braking = Braking(problem)
    commands, longest = braking.ramp(command), max(round(LONGEST_RAMP / dt), 1)
    assert len(commands) == min(
        max(1, int(np.ceil(max(abs(v) / limits[0], abs(omega) / limits[1]) - 1e-9))), longest
    )
    assert not commands[-1].any()
    all_of_them = np.vstack([command, commands])
    assert (np.diff(np.abs(all_of_them), axis=0) <= 1e-12).all()
    np.testing.assert_allclose(all_of_them[:, 0] * omega, all_of_them[:, 1] * v, atol=1e-9)
    if len(commands) < longest:
        # no faster than either limit allows
        assert (np.abs(np.diff(all_of_them, axis=0)) <= limits * (1 + 1e-6) + 1e-9).all()


def test_the_pose_at_rest_is_that_of_braking_period_by_period() -> None:
    braking, command, x = (
        Braking(WEAK),
        np.array([0.33, 0.0]),
        np.array([0.1, 0.2, 0.5]),
    )
    expected = braking.pose_at_rest(x, command)
    while command[0] > 0.0:
        command = np.maximum(command - DT * WEAK.du_max, 0.0)
        x = MODEL.predict(x, command)
    np.testing.assert_allclose(expected, x, atol=1e-9)
    np.testing.assert_allclose(Braking(ONE).pose_at_rest(x, np.array([0.6, 0.0])), x)
