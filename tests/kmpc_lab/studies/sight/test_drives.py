"""The study of sight: its worlds, its account of what was seen, and its counts."""

import numpy as np
import pytest

from kmpc_lab.sim.lidar import LidarSpec, box_edges
from kmpc_lab.studies.any_robot import STANDARD
from kmpc_lab.studies.sight.drives import SightDrive, SightLoop, drive
from kmpc_lab.studies.sight.table import format_rows, summary
from kmpc_lab.studies.sight.worlds import KINDS, Course, course_of
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
    row = SightLoop(driver, STANDARD, course, LidarSpec(4.0), 0).run("empty", 0)
    assert row.arrived and not row.collided
    assert row.unseen == row.unreachable == 0 and row.stopped == 0.0


def test_what_comes_into_view_makes_the_robot_turn_where_it_is() -> None:
    """Not drive back to where the path around it begins: it sees four of its radii."""
    row = drive("ours", "Husky-like", "maze", 2.0, 656001)
    assert row.arrived and not row.collided and row.gears <= 6


def test_the_table_compares_the_same_worlds() -> None:
    def row(driver: str, seed: int, seconds: float, arrived: bool = True) -> SightDrive:
        rest = (0.1, 1, 0.0, 0, 0, 1.0, "waiting: for nothing")
        return SightDrive(driver, "standard", "maze", 4.0, seed, arrived, False, seconds, *rest)

    rows = [row("ours", 1, 10.0), row("pursuit", 1, 20.0), row("ours", 2, 99.0, False)]
    found = summary(rows)
    assert found["ratio_median"] == 0.5 and found["arrived"] == 1
    rows += [row("ours", 3, 40.0), row("pursuit", 3, 20.0)]
    found = summary(rows)
    assert found["ratio_median"] == 1.25 and found["times_median"] == pytest.approx(25.0 / 20.0)
    assert found["times_p90"] == pytest.approx(37.0 / 20.0)
    assert "maze 2, reach 4 m: waiting: for nothing" in format_rows(rows)
