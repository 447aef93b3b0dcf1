"""The lattice's own path, when no path of the tangent graph along it is clear."""

from typing import Any

import numpy as np
import pytest
from paths import all_paths

import kmpc_lite as kl
from kmpc_lite.control.path.lattice import Lattice
from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.tangent_graph import PathQuery
from kmpc_lite.control.world.solids import Solids

AREA = np.array([-100.0, -100.0, 100.0, 100.0])
SPEED = np.array([0.6, np.pi / 4])


def test_a_path_may_cut_the_cells_of_a_grid_by_two_centimetres() -> None:
    lattice = Lattice(Solids([kl.OccupancyGrid(np.ones((1, 200), dtype=bool), 0.05)]))
    lattice.cover(np.array([0.0, 1.0]), np.array([10.0, 1.0]))
    path = LatticePath(lattice, np.array([[2.0, 1.0], [8.0, 1.0]]), 0.3, 1.0)
    for depth, cuts in ((0.0195, False), (0.0205, True)):
        along = np.array([[2.0, 0.05 + 0.3 - depth], [8.0, 0.05 + 0.3 - depth]])
        assert bool(len(path.cut(along))) is cuts


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


@pytest.mark.parametrize(("heading", "reverse"), [(0.75, False), (0.75 - np.pi, True)])
def test_the_lattices_own_path_is_driven_in_the_quicker_gear(heading: float, reverse: bool) -> None:
    asked = query(np.empty((0, 2)), 0.0, AlwaysCut())
    asked.start[2] = asked.goal[2] = heading
    (found,) = all_paths(asked)
    assert found.reverse is reverse
    # direction of travel, whichever way the robot faces
    np.testing.assert_allclose(np.mod(found.headings, 2.0 * np.pi)[:2], np.pi / 4)
