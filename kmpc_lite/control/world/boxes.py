"""The occupied cells of a grid as rectangles along its axes: how far points are, and which way."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.boxes import away
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.types import Array

GRID_COLUMNS = 4
"""Half-planes that a grid has at each stage: the nearest rectangle, then the nearest that does not
lie behind those taken."""
BEHIND = 1e-3
"""`behind` of rectangles that are exact [m]."""


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

    def choose(self, points: Array) -> tuple[Array, Array, Array]:
        """Choose the rectangles that matter at points (n, 2) [m].

        Their numbers (n, K), distances (n, K) [m] and normals (n, K, 2) in the map are returned.
        """
        columns, here = min(GRID_COLUMNS, len(self.low)), self.grid.to_grid(points)
        asked = self.low, self.high, here, self._behind, columns
        chosen, distance, normals = library.nearest_boxes(*asked)
        return chosen, distance, self.grid.turn(normals)
