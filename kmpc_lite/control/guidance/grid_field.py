"""Distances of a grid's cells from its occupied ones, and of places between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.occupancy import OccupancyGrid


class GridField:
    """A grid with a border of free cells around it.

    Parameters
    ----------
    grid : OccupancyGrid
        Whose.
    options : GuidanceOptions
        In metres.
    """

    def __init__(self, grid: OccupancyGrid, options: GuidanceOptions) -> None:
        self._grid, joined = grid, cells_joined(grid, options)
        self._side = joined * grid.resolution
        self._border = math.ceil(2.0 * options.lattice_border / self._side)
        blocks = _blocks(grid.occupied, joined)
        distance = ndimage.distance_transform_edt(
            ~np.pad(blocks, self._border), sampling=self._side
        )
        self._distance = distance - 0.5 * self._side
        self.landmarks = grid.to_map(self._side * _pieces(blocks))
        """(L, 2) a point in each of the grid's pieces that hang together [m]."""

    def distances(self, places: Array, axes: list[Array]) -> Array:
        """Distance (n,) of places (n, 2), of all pairs on two axes, from the occupied cells [m]."""
        at = self._rows_and_columns(places, axes)
        found: Array = ndimage.map_coordinates(self._distance, at, order=1, mode="nearest")
        return found

    def _rows_and_columns(self, places: Array, axes: list[Array]) -> Array:
        """Row and column (2, n) of places on the field."""
        grid, side = self._grid, self._side
        if grid.origin[2]:
            at: Array = grid.to_grid(places).T[::-1] / side - 0.5 + self._border
            return at
        x, y = (
            (axis - begin) / side - 0.5 + self._border
            for axis, begin in zip(axes, grid.origin[:2], strict=True)
        )
        at = np.empty((2, len(x), len(y)))
        at[0], at[1] = y, x[:, None]
        return at.reshape(2, -1)


def cells_joined(grid: OccupancyGrid, options: GuidanceOptions) -> int:
    """How many cells of a grid, along each axis, make one cell of its field.

    More than one where they are finer than half a step of the lattice, or would be too many.
    """
    size = grid.resolution * np.array(grid.occupied.shape) + 4.0 * options.lattice_border
    least = math.sqrt(float(size.prod()) / options.lattice_field_cells)
    fine = int(0.5 * options.lattice_step / grid.resolution + 1e-9)
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
    _, first = np.unique(labels, return_index=True)
    row, column = np.unravel_index(first[len(first) - pieces :], labels.shape)
    return np.column_stack([column, row]) + 0.5
