"""What the lattice's options mean for the paper's robot, looked at on both sides of each number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.options import GuidanceOptions, lengths_from_radii
from kmpc_lite.control.path.grid_field import cells_joined
from kmpc_lite.control.path.lattice import Lattice
from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.path_map import PathMap
from kmpc_lite.control.path.tangent_graph import PathQuery
from kmpc_lite.control.path.tangent_search import Part, TangentSearch
from kmpc_lite.control.world.solids import Solids

OPTIONS = lengths_from_radii(GuidanceOptions(), 0.15)
AREA = np.array([-100.0, -100.0, 100.0, 100.0])
NO_CIRCLES = np.empty((0, 5))
SPEED = np.array([0.6, np.pi / 4])


def walls(length: int, *rows: int, side: float = 0.05) -> Solids:
    """Walls along x, one cell thick, in a grid that begins at the origin."""
    cells = np.zeros((max(rows) + 1, length), dtype=bool)
    cells[list(rows)] = True
    return Solids([kl.OccupancyGrid(cells, side)])


@pytest.fixture(scope="module")
def wall() -> Lattice:
    """Laid around a wall of ten metres."""
    lattice = Lattice(walls(200, 0), OPTIONS)
    lattice.cover(np.array([0.0, 1.0]), np.array([10.0, 1.0]))
    return lattice


@pytest.mark.parametrize(("pieces", "lattice"), [(24, False), (25, True)])
def test_the_tangent_graph_takes_the_corners_of_24_rectangles(pieces: int, lattice: bool) -> None:
    cells = np.zeros((2 * pieces, 2), dtype=bool)
    cells[::2, 0] = True
    made = PathMap(Solids([kl.OccupancyGrid(cells, 0.05)]), OPTIONS)
    assert (made.lattice is not None) is lattice


def test_nodes_lie_five_centimetres_apart_and_farther_where_they_are_too_many() -> None:
    small = Lattice(walls(20, 0), OPTIONS)
    small.cover(np.zeros(2), np.ones(2))
    assert small.step == pytest.approx(0.05)
    large = Lattice(walls(20, 0), OPTIONS)
    large.cover(np.zeros(2), np.array([20.0, 30.0]))
    assert len(large._places) == pytest.approx(40_000, rel=0.02)


@pytest.mark.parametrize(("length", "joined"), [(952, 1), (953, 2)])
def test_a_field_has_a_million_cells_at_the_most(length: int, joined: int) -> None:
    # 1.2 m are laid around a grid of 5 cm on each side: 50 m, and more
    cells = np.zeros((length, length), dtype=bool)
    cells[0, 0] = True
    assert cells_joined(kl.OccupancyGrid(cells, 0.05), OPTIONS) == joined


def test_a_step_along_an_obstacle_counts_a_fifth_more() -> None:
    # one row of nodes is free between two walls, as near to them as a path may lead
    lattice = Lattice(walls(200, 0, 11), OPTIONS)
    start, goal = np.array([3.0, 0.3]), np.array([7.0, 0.3])
    lattice.cover(start, goal)
    cost = lattice.find(start, goal, 0.2249, NO_CIRCLES, AREA).cost
    assert cost[lattice._node(start)] == pytest.approx(1.2 * 4.0, rel=0.002)


def test_a_path_may_cut_the_cells_of_a_grid_by_two_centimetres(wall: Lattice) -> None:
    ends = np.array([[2.0, 1.0], [8.0, 1.0]])
    path = LatticePath(wall, ends, 0.3, 1.0)
    for depth, cuts in ((0.0195, False), (0.0205, True)):
        along = np.array([[2.0, 0.05 + 0.3 - depth], [8.0, 0.05 + 0.3 - depth]])
        assert bool(len(path.cut(along))) is cuts


def test_lines_are_looked_at_every_four_centimetres_at_400_points_at_the_most(
    wall: Lattice, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def watched(points: np.ndarray) -> np.ndarray:
        asked.append(len(points))
        return np.ones(points.shape[:-1])

    monkeypatch.setattr(wall, "distances", watched)
    for length in (4.0, 40.0):
        wall.lines_free(np.zeros((1, 2)), np.array([[length, 0.0]]), 0.2)
    coarse, fine = asked[::2], asked[1::2]
    assert fine[0] == pytest.approx(4.0 / 0.04, abs=2) and fine[1] == 400
    assert [8 * few for few in coarse] == pytest.approx(fine, abs=8)


def test_the_farthest_node_in_sight_is_looked_for_among_eighty(wall: Lattice) -> None:
    points = np.column_stack([0.05 * np.arange(200), np.ones(200)])
    bends = LatticePath(wall, points, 0.3, 1.0).points
    np.testing.assert_allclose(bends[:, 0] / 0.05, (0, 79, 158, 199))


def test_four_searches_from_goals_are_kept() -> None:
    lattice = Lattice(walls(20, 0), OPTIONS)
    lattice.cover(np.array([0.0, 0.0]), np.array([1.0, 1.0]))
    for x in np.linspace(0.0, 1.0, 6):
        lattice.path(np.array([0.5, 0.5]), np.array([x, 1.0]), 0.2, NO_CIRCLES, AREA)
    assert len(lattice._searches) == 4


class AlwaysCut:
    """A lattice's path around which every path of the tangent graph comes too near somewhere."""

    def __init__(self) -> None:
        self.points = np.array([[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
        self.corners, self.radius, self.looks = np.empty((0, 2)), 0.0, 0

    def lines_free(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        return np.ones(len(first), dtype=bool)

    def cut(self, points: np.ndarray) -> np.ndarray:
        self.looks += 1
        return np.array([[0.0, -3.0 - self.looks]])


def query(centres: np.ndarray, radius: float, lattice_path: Any = None) -> PathQuery:
    start, goal = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    radii, edges = np.full(len(centres), radius), np.empty((0, 2), dtype=np.intp)
    return PathQuery(start, goal, centres, radii, edges, AREA, SPEED, 1.0, lattice_path)


def test_corners_are_added_twelve_times_before_the_lattices_own_path_is_taken() -> None:
    lattice_path = AlwaysCut()
    search, found = TangentSearch(query(np.empty((0, 2)), 0.0, lattice_path), OPTIONS), None
    while search.part is not Part.NOTHING:
        found = search.advance()
    assert lattice_path.looks == 13
    assert found is not None and found.points[1].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("heading", "reverse"), [(0.75, False), (0.75 - np.pi, True)])
def test_the_lattices_own_path_is_driven_in_the_quicker_gear(heading: float, reverse: bool) -> None:
    asked = query(np.empty((0, 2)), 0.0, AlwaysCut())
    asked.start[2] = asked.goal[2] = heading
    search, found = TangentSearch(asked, OPTIONS), None
    while search.part is not Part.NOTHING:
        found = search.advance()
    assert found is not None and found.reverse is reverse
    # direction of travel, whichever way the robot faces
    np.testing.assert_allclose(np.mod(found.headings, 2.0 * np.pi)[:2], np.pi / 4)


@pytest.mark.parametrize(("count", "gave_up"), [(150, False), (151, True)])
def test_a_graph_takes_150_circles(count: int, gave_up: bool) -> None:
    in_the_way = np.column_stack([np.linspace(-0.9, 0.9, count), np.zeros(count)])
    search = TangentSearch(query(in_the_way, 0.004), OPTIONS)
    search.advance()
    assert search.gave_up is gave_up
