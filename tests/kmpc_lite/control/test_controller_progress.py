"""A plan tells what the robot does about its goal."""

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.plan import GoalProgress

DOOR = [kl.Wall(0.0, -2.0, 0.0, -0.4), kl.Wall(0.0, 0.4, 0.0, 2.0)]


def test_a_pedestrian_in_the_only_way_does_not_make_the_goal_unreachable(
    nominal: kl.KoopmanModel,
) -> None:
    """It may be free a moment later; behind a wall it is not, whatever walks elsewhere."""
    in_the_door, beside = kl.Circle(0.0, 0.0, 0.15, 0.0, 0.05), kl.Circle(-1.5, 1.5, 0.15, 0.1, 0.0)
    for walls, who, progress, words in (
        (DOOR, in_the_door, GoalProgress.WAITING, "something that moves stands in the only way"),
        ([kl.Wall(0.0, -2.0, 0.0, 2.0)], beside, GoalProgress.UNREACHABLE, "no passage"),
    ):
        controller = kl.Controller(nominal, kl.NavigationProblem(**AREA))
        plan = controller.step((-0.6, 0.0, 0.0), (1.5, 0.0, 0.0), [*walls, who])
        assert plan.progress is progress and words in plan.reason
        assert plan.reachable is (progress is GoalProgress.WAITING)


def test_a_robot_that_does_not_move_is_never_driving_for_long(nominal: kl.KoopmanModel) -> None:
    controller, told = kl.Controller(nominal), []
    for _ in range(120):
        plan = controller.step((-1.5, 0.05, 0.0), (1.5, 0.0, 0.0), [kl.Circle(0.0, 0.0, 0.3)])
        told.append(plan.progress)
    assert told[0] is GoalProgress.DRIVING and told[-1] is GoalProgress.WAITING
    assert "no progress" in plan.reason
