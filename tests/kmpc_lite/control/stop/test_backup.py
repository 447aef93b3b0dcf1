"""What is left of a stop trajectory is driven to its end, then the robot brakes and stands."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from kmpc_lite import NavigationProblem
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.stop.backup import Backup, BackupState
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.control.stop.stop_task import StopTrajectory

PROBLEM = NavigationProblem()


class Driving:
    """A backup, with its state, of a robot that drives with a constant command."""

    def __init__(
        self,
        command: tuple[float, float],
        stages: int = 20,
        stop: StopTrajectory = StopTrajectory(),  # noqa: B008 - immutable
    ) -> None:
        self.backup, self.state = Backup(PROBLEM), BackupState()
        inputs = np.tile(command, (stages, 1))
        self.backup.accept(self.state, np.zeros((stages + 1, 3)), inputs, stop)

    def replay(self) -> np.ndarray | None:
        return self.backup.replay(self.state)

    def brake(self, at_once: bool = False) -> np.ndarray:
        return self.backup.brake(self.state, at_once)


def test_brake_goes_down_the_ramp_step_by_step() -> None:
    fallback = Driving((0.55, -0.3))
    for command in Braking(PROBLEM, StopOptions()).ramp(np.array([0.55, -0.3])):
        np.testing.assert_allclose(fallback.brake(), command, atol=1e-12)
    assert not fallback.brake().any()


def test_brake_at_once_is_zero() -> None:
    assert not Driving((0.5, 0.2)).brake(at_once=True).any()


def test_without_a_plan_there_is_nothing_to_replay_and_the_robot_stands() -> None:
    backup, state = Backup(PROBLEM), BackupState()
    assert backup.replay(state) is None
    assert state.expected is None
    assert not backup.brake(state).any()


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
    fallback = Driving((0.5, 0.0), stop=tail)
    for k in range(len(speeds)):
        rest = fallback.replay()
        assert rest is not None
        np.testing.assert_allclose(rest[:, 0], speeds[k:], atol=1e-9)
        fallback.backup.sent(fallback.state, rest[0], np.full(3, float(k)))
        assert fallback.state.expected is not None and fallback.state.expected[0] == k
    assert fallback.replay() is None


def test_braking_drops_the_tail() -> None:
    fallback = Driving((0.5, 0.2))
    fallback.brake()
    assert fallback.replay() is None


def test_a_plan_that_somebody_overwrites_is_still_braked_from() -> None:
    states, inputs = np.zeros((21, 3)), np.tile((0.5, 0.0), (20, 1))
    backup, state = Backup(PROBLEM), BackupState()
    backup.accept(state, states, inputs, StopTrajectory(further=1))
    inputs[:], states[:] = np.nan, np.nan
    rest = backup.replay(state)
    assert rest is not None and state.expected is not None
    np.testing.assert_allclose(rest[:, 0], [0.5, 0.4, 0.3, 0.2, 0.1, 0.0], atol=1e-9)
    assert not state.expected.any()


@pytest.mark.parametrize("replayed", [0, 1, 3])
def test_a_copied_state_goes_on_as_the_one_it_was_copied_from(replayed: int) -> None:
    driving = Driving((0.5, 0.1), stop=StopTrajectory(further=2))
    for _ in range(replayed):
        driving.replay()
    other = pickle.loads(pickle.dumps(driving.state))
    for _ in range(9):
        mine, others = driving.replay(), driving.backup.replay(other)
        assert (mine is None) == (others is None)
        np.testing.assert_array_equal(mine, others)
