"""The braking ramp: as fast as the limits allow, on the curve, to a stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lite import NavigationProblem
from kmpc_lite.control.fallback import Fallback
from kmpc_lite.control.sqp import Trajectory


def driving(command: tuple[float, float], dt: float = 0.1, deceleration: tuple[float, float] = (1.0, 4.0), stages: int = 20) -> Fallback:
    """A fallback whose robot drives with a constant command."""
    fallback = Fallback(NavigationProblem(horizon=stages, dt=dt, deceleration=deceleration))
    fallback.accept(Trajectory(np.zeros((stages + 1, 3)), np.tile(command, (stages, 1)), np.zeros(1)))
    return fallback


@given(
    v=st.floats(-0.6, 0.6), omega=st.floats(-0.78, 0.78), dt=st.floats(0.01, 1.0), limit_v=st.floats(0.1, 5.0), limit_w=st.floats(0.1, 9.0)
)
def test_ramp_ends_at_zero_within_the_limits_on_the_curve(v: float, omega: float, dt: float, limit_v: float, limit_w: float) -> None:
    fallback = driving((v, omega), dt, (limit_v, limit_w))
    limits, last = np.array([limit_v, limit_w]) * dt, np.array([v, omega])
    longest = max(abs(v) / limits[0], abs(omega) / limits[1])
    for _ in range(int(longest) + 2):
        now = fallback.brake()
        assert (np.abs(now) <= np.abs(last) + 1e-12).all()
        assert (now * last >= 0.0).all()
        assert abs(now[0] * omega - now[1] * v) < 1e-9
        if now.any():
            # no faster than either limit allows
            assert (np.abs(last) - np.abs(now) <= limits + 1e-9).all()
        last = now
    assert not last.any()
    assert not fallback.brake().any()


def test_a_robot_that_stands_goes_on_standing() -> None:
    fallback = Fallback(NavigationProblem())
    assert fallback.replay() is None
    assert not fallback.brake().any()


@pytest.mark.parametrize(("dt", "periods"), [(0.1, 5), (0.05, 10), (0.02, 25), (0.25, 2)])
def test_replay_lasts_half_a_second(dt: float, periods: int) -> None:
    fallback = driving((0.5, 0.0), dt, stages=60)
    for k in range(1, periods + 1):
        rest = fallback.replay()
        assert rest is not None
        assert len(rest.inputs) == 60 - k and len(rest.states) == 61 - k
    assert fallback.replay() is None


def test_replay_is_no_longer_than_the_plan() -> None:
    fallback = driving((0.5, 0.0), stages=3)
    assert fallback.replay() is not None
    assert fallback.replay() is not None
    assert fallback.replay() is None


def test_after_braking_the_old_plan_is_gone() -> None:
    fallback = driving((0.5, 0.2))
    fallback.brake()
    assert fallback.replay() is None


def test_braking_begins_at_the_command_that_was_replayed() -> None:
    fallback = Fallback(NavigationProblem())
    inputs = np.tile((0.5, 0.0), (20, 1))
    inputs[1] = (0.3, 0.0)
    fallback.accept(Trajectory(np.zeros((21, 3)), inputs, np.zeros(1)))
    fallback.replay()
    np.testing.assert_allclose(fallback.brake(), [0.2, 0.0])


def test_reset_forgets() -> None:
    fallback = driving((0.5, 0.2))
    fallback.reset()
    assert fallback.replay() is None
    assert not fallback.brake().any()
