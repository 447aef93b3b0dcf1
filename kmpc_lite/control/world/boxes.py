"""The occupied cells of a grid as rectangles along its axes: how far points are, and which way."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import AT
from kmpc_lite.types import Array

GRID_COLUMNS = 4
"""Half-planes that a grid has at each stage: the nearest rectangle, then the nearest that does not
lie behind those taken."""
BEHIND = 1e-3
"""`behind` of rectangles that are exact [m]."""


class Boxes:
    """Rectangles along the axes of a grid.

    Parameters
    ----------
    low, high : ndarray
        Corners (B, 2), (B, 2) [m], in the grid's frame.
    grid : OccupancyGrid
        Whose.
    behind : float
        How far a rectangle's nearest point may stand out of another one's half-plane and count as
        behind it [m].
    """

    def __init__(
        self, low: Array, high: Array, grid: OccupancyGrid, behind: float = BEHIND
    ) -> None:
        self.low, self.high, self.grid, self._behind = low, high, grid, behind
        self._sides = [np.ascontiguousarray(side) for side in (*low.T, *high.T)]

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

    def _away(self, points: Array) -> tuple[Array, Array, Array]:
        """Distances (n, B) [m], negative inside, and x and y (n, B) of the normals times them.

        The normals are in the grid's frame.
        """
        here = self.grid.to_grid(points)
        x_min, y_min, x_max, y_max = self._sides
        x = np.maximum(here[:, :1], x_min)
        y = np.maximum(here[:, 1:], y_min)
        np.minimum(x, x_max, out=x)
        np.minimum(y, y_max, out=y)
        np.subtract(here[:, :1], x, out=x)
        np.subtract(here[:, 1:], y, out=y)
        distance = x * x
        distance += y * y
        np.sqrt(distance, out=distance)
        if distance.min(initial=1.0) <= AT:
            sides = np.stack(
                [
                    here[:, :1] - x_min,
                    here[:, 1:] - y_min,
                    x_max - here[:, :1],
                    y_max - here[:, 1:],
                ],
                axis=-1,
            )
            inside, side = distance <= AT, sides.argmin(axis=-1)
            # a side that is touched still has a direction
            distance = np.where(inside, np.minimum(-sides.min(axis=-1), -AT), distance)
            x = np.where(inside, distance * np.array([-1.0, 0.0, 1.0, 0.0])[side], x)
            y = np.where(inside, distance * np.array([0.0, -1.0, 0.0, 1.0])[side], y)
        return distance, x, y

    def distances(self, points: Array) -> Array:
        """Distances (n, B) of points (n, 2) [m], negative inside."""
        return self._away(points)[0]

    def choose(self, points: Array) -> tuple[Array, Array, Array]:
        """Choose the rectangles that matter at points (n, 2) [m].

        Their numbers (n, K), distances (n, K) [m] and normals (n, K, 2) in the map are returned.
        """
        distance, x, y = self._away(points)
        count, rows = distance.shape[1], np.arange(len(points))
        columns = min(GRID_COLUMNS, count)
        if columns == count:
            chosen = np.broadcast_to(np.arange(columns), distance.shape)
        else:
            chosen = np.empty((len(points), columns), dtype=np.intp)
            left = distance.copy()
            for i in range(columns):
                nearest = left.argmin(axis=1)
                chosen[:, i] = nearest
                if i + 1 < columns:
                    # what lies behind the nearest one's half-plane, itself included, is done with
                    nearest += count * rows
                    near = distance.take(nearest)
                    along = x * (x.take(nearest) / near)[:, None]
                    along += y * (y.take(nearest) / near)[:, None]
                    np.putmask(left, along >= (near - self._behind)[:, None], np.inf)
            place = chosen + (count * rows)[:, None]
            distance, x, y = distance.take(place), x.take(place), y.take(place)
        normals = np.empty((*distance.shape, 2))
        normals[..., 0], normals[..., 1] = x / distance, y / distance
        return chosen, distance, self.grid.turn(normals)
