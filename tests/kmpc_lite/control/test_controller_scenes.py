"""Scenes that a robot meets: obstacles at odd places, goals out of reach, a pose that is not where
it should be.
"""

import numpy as np
import pytest
from exact_drives import MODEL, PAPER, Drive

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA

IN_AREA = kl.NavigationProblem(**AREA)


@pytest.mark.xfail(
    strict=True,
    reason="known limit: without guidance a far goal outweighs the penalty on leaving the area",
)
def test_nothing_pulls_the_robot_out_of_the_area_without_guidance() -> None:
    drive = Drive(
        kl.Controller(MODEL, IN_AREA, **PAPER), (1.9, 0, 0), (50.0, 30.0, 0.0), periods=100
    )
    assert np.abs(drive.path[:, :2]).max() < 2.02


def test_more_obstacles_than_slots() -> None:
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = [kl.Circle(0.5 + 1.2 * np.cos(a), 0.5 + 1.2 * np.sin(a), 0.05) for a in angles]
    goal = (0.9, 0.9, 0.8)
    drive = Drive(
        kl.Controller(MODEL, obstacle_slots=2),
        (0, 0, 0),
        goal,
        [*ring, kl.Circle(0.55, 0.45, 0.05)],
        periods=60,
    )
    assert drive.clearance > -0.01
    assert drive.distance(0.9, 0.9) < 0.1
    # and a number that changes from one period to the next
    controller = kl.Controller(MODEL, obstacle_slots=2)
    for count in (0, 1, 41, 3, 0, 7):
        assert controller.step((0, 0, 0), goal, ring[:count]).status in (
            kl.PlanStatus.SOLVED,
            kl.PlanStatus.FEASIBLE,
        )
