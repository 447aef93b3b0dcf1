"""The study of sight: its worlds, its account of what was seen, and its counts."""

import numpy as np
import pytest

from kmpc_lab.sim.lidar import LidarSpec, box_edges
from kmpc_lab.studies.any_robot import STANDARD
from kmpc_lab.studies.sight import KINDS, Course, course_of, judge
from kmpc_lite.scenario.world import World


@pytest.mark.parametrize("kind", KINDS)
def test_worlds_follow_from_the_seed_and_the_robots_size(kind: str) -> None:
    first, again, large = (
        course_of(kind, 3, 0.15),
        course_of(kind, 3, 0.15),
        course_of(kind, 3, 0.3),
    )
    np.testing.assert_array_equal(first.world.edges, again.world.edges)
    np.testing.assert_allclose(2.0 * first.world.edges, large.world.edges)
    ends = np.stack([first.start, first.goal])[:, :2]
    assert first.world.clearance(ends, np.zeros(2)).min() > 0.15


@pytest.mark.parametrize("driver", ["ours", "pursuit"])
def test_both_drivers_arrive_in_an_empty_room(driver: str) -> None:
    world = World(np.empty((0, 5)), box_edges(-1.5, -1.5, 1.5, 1.5))
    course = Course("empty", world, np.array([-0.5, 0.0, 0.0]), np.array([0.4, 0.0, 0.0]), 3.0)
    row = judge(driver, STANDARD, course, LidarSpec(4.0), 0)
    assert row.arrived and not row.collided
    assert row.more["unseen"] == row.more["unreachable"] == row.stopped == 0
