"""A pose that jumps stops the robot until poses agree again, and nothing is learned from it."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array

DT = 0.1
GOAL = (1.8, 0.0, 0.0)
NO_STEPS = 12  # steps before the jump: the robot is at full speed


def drive(
    controller: kl.Controller,
    off: Callable[[int], Array],
    steps: int = 80,
    slip: float = 0.05,
    circles: tuple[kl.Circle, ...] = (),
) -> tuple[list[Plan], Array]:
    """Plans, and true poses (T + 1, 3), of a drive whose pose is wrong by `off(step)`."""
    pose, plant, plans = np.zeros(3), kmpc_lab.DifferentialDrive(slip, seed=1), []
    poses = [pose]
    for k in range(steps):
        plans.append(controller.step(pose + off(k), GOAL, circles))
        pose = plant.step(pose, plans[-1].command, DT)
        poses.append(pose)
    return plans, np.array(poses)


def jump(x: float, y: float, turn: float, first: int, after: int) -> Callable[[int], Array]:
    """Wrong by this from one step on until another."""
    off = np.array([x, y, turn])
    return lambda k: off if first <= k < after else np.zeros(3)


def waiting(plans: list[Plan]) -> list[int]:
    return [k for k, plan in enumerate(plans) if plan.reason.startswith("the pose jumped")]


def test_a_pose_that_stays_where_it_jumped_to_is_believed_after_two_seconds() -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    plans, poses = drive(controller, jump(0.3, 0.2, 0.1, NO_STEPS, 1000), 110)
    assert len(waiting(plans)) == pytest.approx(20, abs=1)
    assert np.hypot(*(poses[-1] + (0.3, 0.2, 0.1) - GOAL)[:2]) < 0.03


def test_a_pose_that_jumps_all_the_time_is_never_believed() -> None:
    random = np.random.default_rng(0)
    wrong = random.uniform(-1.0, 1.0, (80, 3))
    controller = kl.Controller(kl.nominal_unicycle(DT))
    plans, _ = drive(controller, lambda k: wrong[k] if k >= NO_STEPS else np.zeros(3))
    assert not any(plan.command.any() for plan in plans[NO_STEPS + 20 :])


@pytest.mark.parametrize("lost", [(NO_STEPS,), (NO_STEPS + 1,), tuple(range(NO_STEPS, 18))])
def test_a_pose_that_is_lost_beside_a_jump_makes_the_jump_no_truer(lost: tuple[int, ...]) -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    off = jump(1.0, 0.5, 0.3, NO_STEPS, 1000)
    plans, _ = drive(controller, lambda k: off(k) if k not in lost else np.full(3, np.nan), 30)
    assert set(range(NO_STEPS, 30)) == set(waiting(plans)) | set(lost)


@pytest.mark.parametrize("periods", [1, 5, 100])
@pytest.mark.parametrize("slip", [0.05, 0.2])
def test_a_pose_that_was_lost_is_believed_where_the_robot_can_have_come_to(
    periods: int, slip: float
) -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    off, end = np.full(3, np.nan), NO_STEPS + periods
    plans, _ = drive(
        controller, lambda k: off if NO_STEPS <= k < end else np.zeros(3), end + 40, slip
    )
    assert waiting(plans) == [] and plans[-1].holding


@pytest.mark.parametrize("lost", [(), (NO_STEPS + 1,), (NO_STEPS + 20,)])
@pytest.mark.parametrize("comes_back", [True, False])
def test_what_scans_showed_is_forgotten_where_poses_stay_elsewhere(
    lost: tuple[int, ...], comes_back: bool
) -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    random, wall = np.random.default_rng(0), 1.5
    back = NO_STEPS + 10 if comes_back else 1000
    off = jump(0.0, 1.0, 0.0, NO_STEPS, back)
    for k in range(NO_STEPS + 30):
        pose = off(k) if k not in lost else np.full(3, np.nan)
        ranges = wall + random.normal(0.0, 0.005, 90)
        scan = kl.LaserScan(ranges, -np.pi, 2 * np.pi / 90, 4.0)
        controller.step(pose, GOAL, [scan], sent=(0.0, 0.0))
    seen = controller.state.seen
    assert seen is not None
    top, bottom, left, right = seen.window(np.array([0.0, -wall]), 0.1)
    assert bool((seen.state[top:bottom, left:right] > 0).any()) == comes_back


def test_an_unknown_command_ends_a_doubt_and_what_scans_showed() -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    scan = kl.LaserScan(np.full(90, 1.5), -np.pi, 2 * np.pi / 90, 4.0)
    for _ in range(5):
        controller.step((0.0, 0.0, 0.0), GOAL, [scan])
    before = controller.state.seen
    assert controller.step((0.0, 1.0, 0.0), GOAL).reason.startswith("the pose jumped")
    assert controller.state.seen is before
    controller.step((0.0, 1.0, 0.0), GOAL, sent=(np.nan, np.nan))
    assert controller.state.seen is None


def test_a_waiting_robot_stops_as_it_was_verified() -> None:
    wall = kl.Circle(1.2, 0.4, 0.2)
    controller = kl.Controller(kl.nominal_unicycle(DT))
    for first in range(8, 24, 5):
        _, poses = drive(
            copy.deepcopy(controller), jump(0.0, 0.3, 0.0, first, first + 15), 60, circles=(wall,)
        )
        assert np.hypot(poses[:, 0] - wall.x, poses[:, 1] - wall.y).min() > 0.35


def test_nothing_is_learned_from_a_jump() -> None:
    plain, jumping = (kl.Controller(kl.nominal_unicycle(DT), adaptation=True) for _ in range(2))
    drive(plain, lambda k: np.zeros(3), 40)
    drive(jumping, jump(0.5, 0.5, 0.0, NO_STEPS, NO_STEPS + 1), 40)
    assert plain.adaptation is not None and jumping.adaptation is not None
    assert jumping.adaptation.counts.rejected == plain.adaptation.counts.rejected
    assert jumping.state.innovation.level <= 1.5 * plain.state.innovation.level + 0.5


def test_a_drive_goes_on_after_a_copy_in_the_middle_of_a_jump() -> None:
    controller = kl.Controller(kl.nominal_unicycle(DT))
    off = jump(0.3, 0.0, 0.0, NO_STEPS, NO_STEPS + 10)
    drive(controller, off, NO_STEPS + 5)
    other = pickle.loads(pickle.dumps(controller))
    for k in range(20):
        pose = np.array([0.7 + 0.3 * (k < 5), 0.0, 0.0])
        plans = controller.step(pose, GOAL), other.step(pose, GOAL)
        np.testing.assert_array_equal(plans[0].inputs, plans[1].inputs)
        assert plans[0].reason == plans[1].reason
