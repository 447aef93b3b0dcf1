"""Distances of a grid's cells from its occupied ones, and of places between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.occupancy import OccupancyGrid

LATTICE_FIELD_CELLS = 1_000_000
"""Most cells for which the distance to the nearest obstacle is worked out. Cells of a larger or
finer grid are joined to blocks, which count as occupied where one of their cells is."""
LATTICE_BORDER = 0.6
"""How far a path may lead around the outermost obstacle, start or goal [m]."""


class GridField:
    """A grid with a border of free cells around it.

    Parameters
    ----------
    grid : OccupancyGrid
        Whose.
    step : float
        Least distance between two nodes of the lattice [m].
    limits : tuple of ndarray
        Corners (2,), (2,) beyond which no distance is asked for [m].
    """

    def __init__(self, grid: OccupancyGrid, step: float, limits: tuple[Array, Array]) -> None:
        self._grid, joined = grid, cells_joined(grid, step)
        self._side = joined * grid.resolution
        blocks = _blocks(grid.occupied, joined)
        border = self._borders(blocks.shape, math.ceil(2.0 * LATTICE_BORDER / self._side), limits)
        self._border = border[:, 0]
        self._distance = self._side * (_away(np.pad(blocks, border)) - 0.5)
        self.landmarks = grid.to_map(self._side * _pieces(blocks))
        """(L, 2) a point in each of the grid's pieces that hang together [m]."""

    def _borders(
        self, shape: tuple[int, ...], most: int, limits: tuple[Array, Array]
    ) -> NDArray[np.intp]:
        """Free cells around (2, 2): before the first row and behind the last, so for columns."""
        if self._grid.origin[2]:
            return np.full((2, 2), most)
        begin = np.array(self._grid.origin[:2])
        end = begin + self._side * np.array(shape[::-1])
        # one more, since distances are of the cells' middles
        beyond = np.stack([begin - limits[0], limits[1] - end], axis=1) / self._side + 1.0
        found: NDArray[np.intp] = np.clip(np.ceil(beyond), 0, most).astype(np.intp)[::-1]
        return found

    def distances(self, places: Array) -> Array:
        """Distance (n,) of places (n, 2) from the occupied cells [m]."""
        at = self._grid.to_grid(places).T[::-1] / self._side - 0.5 + self._border[:, None]
        found: Array = ndimage.map_coordinates(self._distance, at, order=1, mode="nearest")
        return found


def _away(occupied: NDArray[np.bool_]) -> Array:
    """Distances (H, W) of cells from the nearest occupied one, in cells."""
    # half the time of having the distances worked out, too
    rows, columns = ndimage.distance_transform_edt(
        ~occupied, return_distances=False, return_indices=True
    )
    rows -= np.arange(rows.shape[0], dtype=rows.dtype)[:, None]
    columns -= np.arange(rows.shape[1], dtype=rows.dtype)
    squares = np.multiply(rows, rows, dtype=float)
    squares += np.multiply(columns, columns, dtype=float)
    found: Array = np.sqrt(squares, out=squares)
    return found


def cells_joined(grid: OccupancyGrid, step: float) -> int:
    """How many cells of a grid, along each axis, make one cell of its field.

    More than one where they are finer than half a step of the lattice, or would be too many.
    """
    size = grid.resolution * np.array(grid.occupied.shape) + 4.0 * LATTICE_BORDER
    least = math.sqrt(float(size.prod()) / LATTICE_FIELD_CELLS)
    fine = int(0.5 * step / grid.resolution + 1e-9)
    return max(1, fine, math.ceil(least / grid.resolution - 1e-9))


def _blocks(occupied: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Blocks of so many cells a side, occupied where a cell of theirs is."""
    if side == 1:
        return occupied
    rows, columns = (np.arange(0, length, side) for length in occupied.shape)
    return np.logical_or.reduceat(np.logical_or.reduceat(occupied, rows, axis=0), columns, axis=1)


def _pieces(blocks: NDArray[np.bool_]) -> Array:
    """Column and row (L, 2) of the middle of a block in each piece that hangs together."""
    labels, pieces = ndimage.label(blocks, np.ones((3, 3)))
    occupied = np.flatnonzero(labels)[::-1]
    first = np.empty(pieces + 1, dtype=np.intp)
    # of the blocks of a piece the one that comes last counts: the first of all
    first[labels.ravel()[occupied]] = occupied
    row, column = np.divmod(first[1:], labels.shape[1])
    return np.column_stack([column, row]) + 0.5
