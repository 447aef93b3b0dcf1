"""The study of sight: its worlds, its account of what was seen, and its counts."""

from __future__ import annotations

import numpy as np
import pytest

from kmpc_lab.sim.lidar import LidarSpec, box_edges
from kmpc_lab.studies.any_robot import STANDARD
from kmpc_lab.studies.sight.circles import sight_law
from kmpc_lab.studies.sight.drives import SightDrive, SightLoop, _gears, drive
from kmpc_lab.studies.sight.seen_cells import SeenCells
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


def test_what_no_beam_went_through_was_never_seen() -> None:
    cells = SeenCells(4.0, 0.15)
    directions = np.arange(360) * 2 * np.pi / 360 - np.pi
    ranges = np.where(np.abs(directions) < 0.5, np.nan, 1.0)
    pose = np.zeros(3)
    cells.look(pose, ranges, directions, 4.0)
    behind, ahead = np.array([[-0.5, 0.0]]), np.array([[0.5, 0.0]])
    assert not cells.enters_unseen(behind, pose)
    assert cells.enters_unseen(ahead, pose)
    assert cells.enters_unseen(np.array([[-1.2, 0.0]]), pose)
    assert not cells.enters_unseen(pose[None, :2], pose)


@pytest.mark.parametrize("driver", ["ours", "pursuit"])
def test_both_drivers_arrive_in_an_empty_room(driver: str) -> None:
    world = World(np.empty((0, 5)), box_edges(-1.5, -1.5, 1.5, 1.5))
    course = Course("empty", world, np.array([-0.5, 0.0, 0.0]), np.array([0.4, 0.0, 0.0]), 3.0)
    row = SightLoop(driver, STANDARD, course, LidarSpec(4.0), 0).run("empty", 0)
    assert row.arrived and not row.collided
    assert row.unseen == row.unreachable == 0 and row.stopped == 0.0


def test_what_comes_into_view_makes_the_robot_turn_where_it_is() -> None:
    """Not drive back to where the path around it begins: it sees four of its radii."""
    row = drive("ours", "Husky-like", "maze", 2.0, 656000)
    assert row.arrived and not row.collided and row.gears <= 6


@pytest.mark.parametrize(
    ("door", "noise"),
    [(0.36, 0.0), (0.36, 0.01), (0.40, 0.02), (0.50, 0.03)],
)
def test_a_door_that_the_robot_fits_through_is_driven(door: float, noise: float) -> None:
    """However its sides lie in the cells of the map; what is told of walls passes the same."""
    for middle in (0.0, 0.031, -0.017):
        edges = [
            box_edges(-0.05, middle + 0.5 * door, 0.05, 1.5),
            box_edges(-0.05, -1.5, 0.05, middle - 0.5 * door),
            box_edges(-2.0, -1.5, 2.0, 1.5),
        ]
        world = World(np.empty((0, 5)), np.concatenate(edges))
        start, goal = np.array([-1.2, 0.4, 0.0]), np.array([1.2, -0.3, 0.0])
        course = Course("door", world, start, goal, 4.0)
        row = SightLoop("ours", STANDARD, course, LidarSpec(4.0, noise=noise), 0).run("door", 0)
        assert row.arrived and not row.collided and row.unreachable == 0


def test_a_gear_changes_where_the_robot_drives_back() -> None:
    driven = np.array([0.1, 0.1, -0.01, 0.01, -0.01, 0.1, -0.05, -0.05, 0.2])
    assert _gears(driven, 0.03) == 2


def test_the_law_is_that_of_a_robot_that_stops_within_its_sight() -> None:
    speed = sight_law(0.5, 9.0)
    assert speed * 0.1 + speed**2 / 3.0 == pytest.approx(0.5)
    assert sight_law(9.0, 0.6) == 0.6


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
