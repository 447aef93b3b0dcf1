"""What a robot stops before where a step is refused: all that it sees in that step."""

import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.lidar import box_edges
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

ROOM = box_edges(-6.0, -6.0, 6.0, 6.0)
GOAL, NO_GOAL = (4.0, 0.0, 0.0), (np.nan, 0.0, 0.0)
BEAMS = 360


def scan(pose: Array, ahead: float = math.inf) -> kl.LaserScan:
    """Of a room in which perhaps something stands so far ahead."""
    directions = (np.arange(BEAMS) + 0.5) * math.tau / BEAMS - math.pi
    circles = [(pose[0] + ahead + 0.3, pose[1], 0.3, 0.0, 0.0)] if ahead < math.inf else []
    ranges = World(circles, ROOM).ranges(pose[:2], pose[2] + directions)
    return kl.LaserScan(ranges, directions[0], math.tau / BEAMS, 20.0)


@pytest.fixture
def driving() -> tuple[kl.Controller, Array]:
    """A robot that brakes slowly, at full speed, and where it is."""
    problem = kl.NavigationProblem(
        x_min=(-6.0, -6.0, -np.inf),
        x_max=(6.0, 6.0, np.inf),
        du_max=(0.5, 2.0),
        deceleration=(0.5, 2.0),
    )
    controller, pose = kl.Controller(kl.nominal_unicycle(0.1), problem), np.array([-3.0, 0.0, 0.0])
    for _ in range(30):
        pose = controller.step(pose, GOAL, [scan(pose)]).states[1]
    return controller, pose


@pytest.mark.parametrize(
    ("ahead", "status"), [(math.inf, kl.PlanStatus.FALLBACK), (0.4, kl.PlanStatus.STOPPED)]
)
def test_a_step_that_is_refused_looks_at_its_scans(
    driving: tuple[kl.Controller, Array], ahead: float, status: kl.PlanStatus
) -> None:
    controller, pose = driving
    plan = controller.step(pose, NO_GOAL, [scan(pose, ahead)])
    assert plan.status is status and "goal not usable" in plan.reason
    assert (plan.clearance < 0.3) == (ahead < 1.0)


@pytest.mark.parametrize("wrong", [(np.nan, 0.0, 0.0), (0.0, 3.0, 0.0)], ids=["lost", "jumped"])
def test_what_was_seen_gets_older_while_the_pose_is_not_known(
    driving: tuple[kl.Controller, Array], wrong: tuple[float, float, float]
) -> None:
    controller, pose = driving
    assert controller.state.seen is not None
    clock, before = controller.state.seen.clock, controller.state.seen.state.copy()
    for _ in range(10):
        controller.step(pose + wrong, GOAL, [scan(pose)])
    assert controller.state.seen.clock == pytest.approx(clock + 1.0)
    np.testing.assert_array_equal(controller.state.seen.state, before)
