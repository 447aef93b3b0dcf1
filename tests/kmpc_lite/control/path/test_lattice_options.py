"""The lattice's own path, when no path of the tangent graph along it is clear."""

from typing import Any

import numpy as np
import pytest
from paths import all_paths

from kmpc_lite.control.path.tangent_graph import PathQuery

AREA = np.array([-100.0, -100.0, 100.0, 100.0])
SPEED = np.array([0.6, np.pi / 4])


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
