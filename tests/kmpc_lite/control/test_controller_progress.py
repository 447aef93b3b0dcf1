"""A plan tells what the robot does about its goal."""

from __future__ import annotations

import numpy as np

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.plan import GoalProgress

RING = [kl.Circle(1 + 0.6 * np.cos(a), 0.6 * np.sin(a), 0.2) for a in np.arange(12) * np.pi / 6]


def test_a_goal_out_of_reach_is_told_with_the_first_plan(nominal: kl.KoopmanModel) -> None:
    for goal, obstacles, words in (
        ((1.0, 0.0, 0.0), [kl.Circle(1.2, 0.0, 0.2)], "would touch"),
        ((1.0, 0.0, 0.0), RING, "no passage"),
    ):
        plan = kl.Controller(nominal).step((-1.5, 0.0, 0.0), goal, obstacles)
        assert plan.progress is GoalProgress.UNREACHABLE and not plan.reachable
        assert words in plan.reason and plan.status is kl.PlanStatus.SOLVED
        assert np.abs(plan.command).max() < 0.01


DOOR = [kl.Wall(0.0, -2.0, 0.0, -0.4), kl.Wall(0.0, 0.4, 0.0, 2.0)]


def test_a_pedestrian_in_the_only_way_does_not_make_the_goal_unreachable(
    nominal: kl.KoopmanModel,
) -> None:
    """It may be free a moment later; behind a wall it is not, whoever walks elsewhere."""
    in_the_door, beside = kl.Circle(0.0, 0.0, 0.15, 0.0, 0.05), kl.Circle(-1.5, 1.5, 0.15, 0.1, 0.0)
    for walls, who, progress, words in (
        (DOOR, in_the_door, GoalProgress.WAITING, "something that moves stands in the only way"),
        ([kl.Wall(0.0, -2.0, 0.0, 2.0)], beside, GoalProgress.UNREACHABLE, "no passage"),
    ):
        controller = kl.Controller(nominal, kl.NavigationProblem(**AREA))
        plan = controller.step((-0.6, 0.0, 0.0), (1.5, 0.0, 0.0), [*walls, who])
        assert plan.progress is progress and words in plan.reason
        assert plan.reachable is (progress is GoalProgress.WAITING)


def test_the_nearest_pose_to_a_goal_outside_the_area_is_driven_to(nominal: kl.KoopmanModel) -> None:
    controller = kl.Controller(nominal, kl.NavigationProblem(**AREA))
    robot, x = kmpc_lab.DifferentialDrive(), np.zeros(3)
    for _ in range(100):
        plan = controller.step(x, (3.0, 0.5, 0.3))
        assert plan.progress is GoalProgress.UNREACHABLE
        assert not plan.reachable and not plan.holding and "outside the area" in plan.reason
        x = robot.step(x, plan.command, 0.1)
    assert not plan.command.any()
    assert np.hypot(x[0] - 2.0, x[1] - 0.5) < 0.02 and abs(x[2] - 0.3) < 0.05


def test_a_robot_that_does_not_move_is_never_driving_for_long(nominal: kl.KoopmanModel) -> None:
    controller, told = kl.Controller(nominal), []
    for _ in range(120):
        plan = controller.step((-1.5, 0.05, 0.0), (1.5, 0.0, 0.0), [kl.Circle(0.0, 0.0, 0.3)])
        told.append(plan.progress)
    assert told[0] is GoalProgress.DRIVING and told[-1] is GoalProgress.WAITING
    assert "no progress" in plan.reason


def test_a_drive_ends_holding(nominal: kl.KoopmanModel) -> None:
    controller, robot, x = kl.Controller(nominal), kmpc_lab.DifferentialDrive(), np.zeros(3)
    told = []
    for _ in range(80):
        plan = controller.step(x, (0.8, 0.3, 0.5))
        told.append(plan.progress)
        x = robot.step(x, plan.command, 0.1)
    first = told.index(GoalProgress.HOLDING)
    assert set(told[:first]) == {GoalProgress.DRIVING}
    assert set(told[first:]) == {GoalProgress.HOLDING}
