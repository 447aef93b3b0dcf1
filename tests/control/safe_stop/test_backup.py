"""The tail that is left of a plan, and the braking ramp: as fast as the limits allow, on the curve, to a stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lite import NavigationProblem
from kmpc_lite.control.nmpc.sqp import Trajectory
from kmpc_lite.control.safe_stop.backup import Backup
from kmpc_lite.control.safe_stop.stop_trajectory import StopTrajectory, ramp


def driving(
    command: tuple[float, float],
    dt: float = 0.1,
    deceleration: tuple[float, float] = (1.0, 4.0),
    stages: int = 20,
    tail: StopTrajectory = StopTrajectory(),  # noqa: B008 - frozen
) -> Backup:
    """A fallback whose robot drives with a constant command."""
    fallback = Backup(NavigationProblem(horizon=stages, dt=dt, deceleration=deceleration))
    fallback.accept(
        Trajectory(np.zeros((stages + 1, 3)), np.tile(command, (stages, 1)), np.zeros(1)), tail
    )
    return fallback


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
    commands = ramp(command, limits)
    assert len(commands) == min(
        max(1, int(np.ceil(max(abs(v) / limits[0], abs(omega) / limits[1]) - 1e-9))), 100
    )
    assert not commands[-1].any()
    all_of_them = np.vstack([command, commands])
    assert (np.diff(np.abs(all_of_them), axis=0) <= 1e-12).all()
    np.testing.assert_allclose(all_of_them[:, 0] * omega, all_of_them[:, 1] * v, atol=1e-9)
    if len(commands) < 100:
        # no faster than either limit allows
        assert (np.abs(np.diff(all_of_them, axis=0)) <= limits * (1 + 1e-6) + 1e-9).all()


def test_brake_goes_down_the_ramp_step_by_step() -> None:
    fallback, step = driving((0.55, -0.3)), np.array([0.1, 0.4])
    expected = ramp(np.array([0.55, -0.3]), step)
    for command in expected:
        np.testing.assert_allclose(fallback.brake(), command, atol=1e-12)
    assert not fallback.brake().any()


def test_brake_at_once_is_zero() -> None:
    assert not driving((0.5, 0.2)).brake(at_once=True).any()


def test_without_a_plan_there_is_nothing_to_replay_and_the_robot_stands() -> None:
    fallback = Backup(NavigationProblem())
    assert fallback.replay() is None
    assert fallback.expected is None
    assert not fallback.brake().any()


@pytest.mark.parametrize(
    ("tail", "speeds"),
    [
        (StopTrajectory(), [0.4, 0.3, 0.2, 0.1, 0.0]),
        (StopTrajectory(further=2), [0.5, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0]),
        (StopTrajectory(at_once=True), [0.0]),
        (StopTrajectory(further=1, at_once=True), [0.5, 0.0]),
    ],
)
def test_a_tail_is_driven_to_its_stop_and_then_is_none(
    tail: StopTrajectory, speeds: list[float]
) -> None:
    fallback = driving((0.5, 0.0), tail=tail)
    for k in range(len(speeds)):
        rest = fallback.replay()
        assert rest is not None
        np.testing.assert_allclose(rest[:, 0], speeds[k:], atol=1e-9)
        fallback.sent(rest[0], np.full(3, float(k)))
        assert fallback.expected is not None and fallback.expected[0] == k
    assert fallback.replay() is None


def test_braking_drops_the_tail() -> None:
    fallback = driving((0.5, 0.2))
    fallback.brake()
    assert fallback.replay() is None


def test_a_plan_that_somebody_overwrites_is_still_braked_from() -> None:
    plan = Trajectory(np.zeros((21, 3)), np.tile((0.5, 0.0), (20, 1)), np.zeros(1))
    fallback = Backup(NavigationProblem())
    fallback.accept(plan, StopTrajectory(further=1))
    plan.inputs[:], plan.states[:] = np.nan, np.nan
    rest = fallback.replay()
    assert rest is not None and fallback.expected is not None
    np.testing.assert_allclose(rest[:, 0], [0.5, 0.4, 0.3, 0.2, 0.1, 0.0], atol=1e-9)
    assert not fallback.expected.any()


def test_reset_forgets() -> None:
    fallback = driving((0.5, 0.2))
    fallback.reset()
    assert fallback.replay() is None
    assert not fallback.brake().any()
