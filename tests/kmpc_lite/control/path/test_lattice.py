"""Paths through grids with many corners."""

import numpy as np
from paths import ended

import kmpc_lite as kl
from kmpc_lite.control.path.lattice import Lattice, LatticeTask
from kmpc_lite.control.path.lattice_path import LATTICE_CUT
from kmpc_lite.control.path.tangent_planner import LATTICE_RECTANGLES
from kmpc_lite.control.world.solids import Solids

AREA = np.array([-3.0, -3.0, 3.0, 3.0])
NO_CIRCLES = np.empty((0, 5))


def slanted(door: int | None = 30) -> kl.OccupancyGrid:
    """A wall across 6 m x 6 m that is slanted, so that it is made of many rectangles, with a
    door of 0.6 m, or none.
    """
    cells = np.zeros((120, 120), dtype=bool)
    for column in range(120):
        if door is None or not door <= column < door + 12:
            cells[40 + column // 3 : 44 + column // 3, column] = True
    return kl.OccupancyGrid(cells, 0.05, (-3.0, -3.0, 0.0))


def test_paths_keep_their_distance_and_bend_where_they_must() -> None:
    solids = Solids([slanted()])
    assert solids.rectangle_count > LATTICE_RECTANGLES
    start, goal = np.array([0.0, -2.5]), np.array([0.0, 2.5])
    lattice = Lattice(solids)
    path = ended(lattice.search(LatticeTask(start, goal, 0.21, NO_CIRCLES, AREA)))
    assert path is not None and 3 <= len(path.points) <= 8
    share = np.linspace(0.0, 1.0, 100)[:, None]
    along = np.concatenate(
        [
            (1 - share) * a + share * b
            for a, b in zip(path.points[:-1], path.points[1:], strict=True)
        ]
    )
    # half a cell of the lattice, and the diagonal of a grid's cell
    assert solids.whole.least(along).min() >= 0.21 - LATTICE_CUT - 0.06
    np.testing.assert_allclose(solids.whole.least(path.corners), 0.0, atol=1e-9)
    # a door that is too narrow, a circle in the door, or no door at all
    assert ended(lattice.search(LatticeTask(start, goal, 0.36, NO_CIRCLES, AREA))) is None
    assert (
        ended(
            lattice.search(
                LatticeTask(start, goal, 0.21, np.array([[-1.2, -0.4, 0.1, 0.0, 0.0]]), AREA)
            )
        )
        is None
    )
    closed = Lattice(Solids([slanted(None)]))
    assert ended(closed.search(LatticeTask(start, goal, 0.21, NO_CIRCLES, AREA))) is None


def test_a_start_near_a_wall_is_left_though_a_search_for_another_start_is_known() -> None:
    lattice = Lattice(Solids([slanted()]))
    goal, far = np.array([0.0, 2.5]), np.array([0.0, -2.5])
    near = np.array([-1.0, -0.46])
    assert 0.15 < lattice.clearance(near) < 0.21
    assert ended(lattice.search(LatticeTask(far, goal, 0.21, NO_CIRCLES, AREA))) is not None
    assert ended(lattice.search(LatticeTask(near, goal, 0.21, NO_CIRCLES, AREA))) is not None
    # and the other way round
    assert ended(lattice.search(LatticeTask(far, goal, 0.21, NO_CIRCLES, AREA))) is not None
