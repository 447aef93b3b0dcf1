"""Occupancy grids: what a map server or a costmap gives, reduced to few rectangles.

Of these it is told how far points are, and which way.
"""

from __future__ import annotations

import os
import warnings
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmpc_lite.control.footprint import FARTHEST
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.library import rectangles
from kmpc_lite.control.options import USUAL_OBSTACLES, ObstacleOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

LEAST_CELL = 1e-4  # least side of a cell [m]: no sensor sees finer
USUAL_THRESHOLD = 65.0  # map_server's, of 100
DOUBTFUL = 50.0
"""Of 100: a cell that is as likely occupied as free, or likelier, is not known to be free."""
AT = 1e-9  # distance at which a direction cannot be told [m]
GRID_COLUMNS = 4
"""Half-planes that a grid has at each stage: the nearest rectangle, then the nearest that does not
lie behind those taken."""
BEHIND = 1e-3  # `behind` of rectangles that are exact [m]


class OccupancyGrid:
    """Cells that are occupied or free, like ``nav_msgs/OccupancyGrid``.

    A grid must not be changed once it is made.

    Parameters
    ----------
    data : array_like
        (height, width) of -1 (unknown) and 0 (free) to 100 (occupied), or booleans; values from 0
        to 1 alone are refused, since nobody knows what they mean. The first row has the lowest y;
        of a message: ``np.reshape(message.data, (info.height, info.width))``.
    resolution : float
        Side of a cell [m].
    origin : array_like
        x, y [m] of the grid's corner at ``data[0, 0]``, and its heading [rad], (2,) or (3,).
    threshold : float
        A cell with this value or more is occupied. Where it is not given, one from 50 up to it is
        unknown; costmaps give their own, 99 or 100.
    unknown_is_free : bool
        Whether the robot may drive if nothing is known; it warns where a cell has 50 or more.
    limits : ObstacleOptions
        How many cells it may have, and how small and how ragged they may be.

    Raises
    ------
    ProblemError
        Names what is wrong.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0], [0, 100, 100]], resolution=0.5, origin=(-1.0, 0.0))
    >>> grid.rectangles.tolist()
    [[0.5, 0.5, 1.5, 1.0]]
    """

    def __init__(
        self,
        data: ArrayLike,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        threshold: float = USUAL_THRESHOLD,
        unknown_is_free: bool = False,
        limits: ObstacleOptions = USUAL_OBSTACLES,
    ) -> None:
        try:
            cells, place = np.asarray(data), np.array(origin, dtype=float)
        except (TypeError, ValueError) as error:
            raise ProblemError(
                f"grid: expected cells (height, width) and an origin x, y, yaw: {error}"
            ) from error
        cells = _checked(cells, threshold, limits)
        _check_resolution(resolution)
        if place.shape not in ((2,), (3,)) or not (np.abs(place) <= FARTHEST).all():
            raise ProblemError(f"grid: expected a finite origin x, y, yaw, got {place.tolist()}")
        self.resolution = float(resolution)
        x, y, *heading = map(float, place)
        self.origin = (x, y, heading[0] if heading else 0.0)
        usual = threshold == USUAL_THRESHOLD
        doubtful = (cells >= DOUBTFUL) & (cells < threshold) & usual
        if unknown_is_free and doubtful.any():
            warnings.warn(
                f"grid: {np.count_nonzero(doubtful):,} cells from {DOUBTFUL:g} to below "
                f"{threshold:g} of 100 count as free, as what is unknown does",
                stacklevel=2,
            )
        self.unknown = (cells < 0) | doubtful
        """(height, width) whether nothing is known."""
        self.occupied: NDArray[np.bool_] = cells >= threshold
        """(height, width) what the robot must not touch."""
        if not unknown_is_free:
            self.occupied = self.occupied | self.unknown
        self._threshold, self._unknown_is_free = threshold, unknown_is_free
        self._limits = limits
        self._prepare()

    def _prepare(self) -> None:
        """Count the runs, and make rectangles of them: now, not in the first step that sees it."""
        limits = self._limits
        for array in (self.unknown, self.occupied):
            array.flags.writeable = False
        self.runs = min(count_runs(self.occupied), count_runs(self.occupied.T))
        """How many runs of occupied cells there are, along rows or columns as these are fewer."""
        if self.runs > limits.grid_runs:
            raise ProblemError(
                f"grid: expected at most {limits.grid_runs:,} runs of occupied cells in its rows "
                f"or columns, got {self.runs:,}: filter the noise, or make the cells larger"
            )
        rows = rectangles(self.occupied)
        columns = rectangles(self.occupied.T)[:, [1, 0, 3, 2]]
        self._blocks = rows if len(rows) <= len(columns) else columns

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        unknown_is_free: bool = False,
        limits: ObstacleOptions = USUAL_OBSTACLES,
    ) -> OccupancyGrid:
        """Read the pair of files that ROS's map_server writes.

        They are ``map.yaml`` and the PGM image that it names.

        Raises
        ------
        ProblemError
            Names the file, and what is wrong with it.
        """
        from kmpc_lite.map_server import read_map

        cells, resolution, origin = read_map(Path(path), limits.grid_cells)
        return cls(cells, resolution, origin, unknown_is_free=unknown_is_free, limits=limits)

    def update(self, patch: ArrayLike, row: int = 0, column: int = 0) -> OccupancyGrid:
        """Return the grid with some cells anew, as ``map_msgs/OccupancyGridUpdate`` tells them.

        Where the patch changes nothing that matters the grid itself is returned, so that nothing is
        prepared anew.

        Parameters
        ----------
        patch : array_like
            (h, w) values as those of the grid.
        row, column : int
            Of the grid's cell that the patch's first one replaces: y and x of the message.

        Raises
        ------
        ProblemError
            For a patch that is no part of the grid, or values that are none.
        """
        new = OccupancyGrid(
            patch, self.resolution, (0.0, 0.0), self._threshold, self._unknown_is_free, self._limits
        )
        height, width = new.occupied.shape
        if row < 0 or column < 0:
            raise ProblemError(f"grid: expected a row and a column >= 0, got {row} and {column}")
        place = slice(row, row + height), slice(column, column + width)
        if self.occupied[place].shape != (height, width):
            raise ProblemError(
                f"grid: a patch of {height} x {width} cells at row {row} and column {column} "
                f"reaches beyond the grid's {self.occupied.shape[0]} x {self.occupied.shape[1]}"
            )
        if np.array_equal(self.occupied[place], new.occupied) and np.array_equal(
            self.unknown[place], new.unknown
        ):
            return self
        other = copy(self)
        other.__dict__.pop("rectangles", None)
        other.unknown, other.occupied = self.unknown.copy(), self.occupied.copy()
        other.unknown[place], other.occupied[place] = new.unknown, new.occupied
        other._prepare()
        return other

    def scaled(self, unit: float) -> OccupancyGrid:
        """Return the same in units of a length [m]; the cells are shared."""
        other = copy(self)
        other.__dict__.pop("rectangles", None)
        other.resolution = self.resolution / unit
        other.origin = (self.origin[0] / unit, self.origin[1] / unit, self.origin[2])
        return other

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OccupancyGrid) and (
            self is other
            or (self.resolution, self.origin) == (other.resolution, other.origin)
            and np.array_equal(self.occupied, other.occupied)
            and np.array_equal(self.unknown, other.unknown)
        )

    def __hash__(self) -> int:
        return hash((self.resolution, self.origin, self.occupied.shape))

    def __repr__(self) -> str:
        height, width = self.occupied.shape
        return (
            f"OccupancyGrid({height} x {width} cells of {self.resolution:g} m, "
            f"origin {self.origin})"
        )

    @cached_property
    def rectangles(self) -> Array:
        """Rectangles that together cover the occupied cells, (B, 4) [m].

        Each is xmin, ymin, xmax, ymax in the grid's own frame.
        """
        found: Array = self.resolution * self._blocks
        return found

    def to_grid(self, points: Array) -> Array:
        """Points (..., 2) of the map in the grid's own frame [m]."""
        away: Array = points - self.origin[:2]
        return away @ self._turn.T if self.origin[2] else away

    def to_map(self, points: Array) -> Array:
        """Points (..., 2) of the grid's own frame in the map [m]."""
        there: Array = self.turn(points) + self.origin[:2]
        return there

    def turn(self, directions: Array) -> Array:
        """Directions (..., 2) of the grid's own frame in the map."""
        return directions @ self._turn if self.origin[2] else directions

    @cached_property
    def _turn(self) -> Array:
        """Matrix (2, 2) that turns rows of the grid's frame into the map's."""
        cos, sin = np.cos(self.origin[2]), np.sin(self.origin[2])
        return np.array([[cos, sin], [-sin, cos]])


def _checked(cells: NDArray[Any], threshold: float, limits: ObstacleOptions) -> NDArray[Any]:
    """Give cells of -1 to 100; ProblemError for any that cannot be meant as such."""
    if cells.size > limits.grid_cells:
        raise ProblemError(
            f"grid: expected at most {limits.grid_cells:,} cells, got {cells.size:,}: "
            "make them larger"
        )
    if cells.ndim != 2 or not cells.size or cells.dtype.kind not in "biuf":
        raise ProblemError(
            f"grid: expected numbers (height, width), got {cells.dtype} of shape {cells.shape}"
        )
    if not 0.0 < threshold <= 100.0:
        raise ProblemError(f"grid: expected a threshold above 0 and up to 100, got {threshold!r}")
    if cells.dtype.kind == "b":
        cells = 100 * cells.astype(np.int8)
    if not (cells.min() >= -1 and cells.max() <= 100):
        raise ProblemError(
            f"grid: expected values from -1 to 100, got {cells.min()} to {cells.max()}"
        )
    known = cells[cells >= 0]
    if 0.0 < known.max(initial=0) <= 1.0 < threshold:
        raise ProblemError(
            "grid: expected 0 (free) to 100 (occupied), or booleans, got values from 0 to 1 "
            "alone: give cells.astype(bool), or 100 times probabilities"
        )
    return cells


def _check_resolution(resolution: float) -> None:
    """Raise ProblemError where the side of a cell is none, or finer or coarser than allowed."""
    if (
        isinstance(resolution, bool)
        or not isinstance(resolution, int | float | np.number)
        or not 0.0 < resolution < np.inf
    ):
        raise ProblemError(f"grid: expected a resolution > 0 m, got {resolution!r}")
    if not LEAST_CELL <= resolution <= FARTHEST:
        raise ProblemError(
            f"grid: expected a resolution of at least {LEAST_CELL:g} m, got {resolution:g} m"
        )


def count_runs(occupied: NDArray[np.bool_]) -> int:
    """How many runs of occupied cells the rows have."""
    begins = np.count_nonzero(occupied[:, 1:] & ~occupied[:, :-1])
    return int(begins + np.count_nonzero(occupied[:, 0]))


def away(low: Array, high: Array, points: Array) -> tuple[Array, Array, Array]:
    """Distances (n, B) [m], negative inside, and x and y (n, B) of the normals times them."""
    here_x, here_y = points[:, :1], points[:, 1:]
    x = here_x - np.minimum(np.maximum(here_x, low[:, 0]), high[:, 0])
    y = here_y - np.minimum(np.maximum(here_y, low[:, 1]), high[:, 1])
    distance = np.sqrt(x * x + y * y)
    if distance.min(initial=1.0) <= AT:
        sides = np.stack(
            [here_x - low[:, 0], here_y - low[:, 1], high[:, 0] - here_x, high[:, 1] - here_y],
            axis=-1,
        )
        inside, side = distance <= AT, sides.argmin(axis=-1)
        # a side that is touched still has a direction
        distance = np.where(inside, np.minimum(-sides.min(axis=-1), -AT), distance)
        x = np.where(inside, distance * np.array([-1.0, 0.0, 1.0, 0.0])[side], x)
        y = np.where(inside, distance * np.array([0.0, -1.0, 0.0, 1.0])[side], y)
    return distance, x, y


class Boxes:
    """Rectangles along the axes of a grid.

    `low`, `high`: corners (B, 2), (B, 2) [m], in the grid's frame. `grid`: whose. `behind`: how far
    a rectangle's nearest point may stand out of another one's half-plane and count as behind it
    [m].
    """

    def __init__(
        self, low: Array, high: Array, grid: OccupancyGrid, behind: float = BEHIND
    ) -> None:
        self.low, self.high = np.ascontiguousarray(low), np.ascontiguousarray(high)
        self.grid, self._behind = grid, behind

    @property
    def outermost(self) -> Array:
        """Corners (4 B, 2) of the rectangles in the map [m]."""
        (x_min, y_min), (x_max, y_max) = self.low.T, self.high.T
        x = np.concatenate([x_min, x_max, x_max, x_min])
        y = np.concatenate([y_min, y_min, y_max, y_max])
        return self.grid.to_map(np.stack([x, y], axis=1))

    def take(self, chosen: Array) -> Boxes:
        """Some of the rectangles."""
        return Boxes(self.low[chosen], self.high[chosen], self.grid, self._behind)

    def distances(self, points: Array) -> Array:
        """Distances (n, B) of points (n, 2) [m], negative inside."""
        return away(self.low, self.high, self.grid.to_grid(points))[0]

    def least(self, points: Array) -> Array:
        """Distances (n,) of points (n, 2) from the nearest rectangle [m], negative inside."""
        return library.box_distances(self.low, self.high, self.grid.to_grid(points))

    def choose(self, points: Array, most: int = GRID_COLUMNS) -> tuple[Array, Array, Array]:
        """Choose the rectangles that matter at points (n, 2) [m]; where but one is, the nearest.

        Their numbers (n, K), distances (n, K) [m] and normals (n, K, 2) in the map are returned.
        """
        here, columns = self.grid.to_grid(points), min(most, len(self.low))
        asked = self.low, self.high, here, self._behind, columns
        chosen, distance, normals = library.nearest_boxes(*asked)
        return chosen, distance, self.grid.turn(normals)
