"""The distance to the start around what is in the way, of a point as wide as the robot's narrowest.

It tells a search where to grow, and whether the goal's place can be reached at all.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.path.distance_grid import Ways
from kmpc_lite.control.path.planner import PathRequest
from kmpc_lite.types import Array

MOST_CELLS = 96
"""Most cells along either axis: larger areas get larger cells."""
ROWS = 8
"""Rows of cells whose clearance is worked out in one part."""
BORDER = 12.0
"""How far it reaches around start, goal and obstacles, in turning or robot radii."""


class PlainField:
    """Distances to the start on a grid, part by part.

    `request`: start, goal, obstacles and area. `radius`: of the robot's circles [m].
    """

    def __init__(self, request: PathRequest, radius: float) -> None:
        self._request, self._radius = request, radius
        arms = float(np.hypot(request.outline[:, 0], request.outline[:, 1]).max())
        low, high = self._extent(BORDER * (radius + arms))
        side = float((high - low).max())
        self._cell = cell = max(0.7 * radius, side / (MOST_CELLS - 1))
        shape = np.ceil((high - low) / cell).astype(int) + 1
        self._low, (self._columns, self._rows) = low, shape.tolist()
        self._free = np.zeros((self._rows, self._columns), dtype=bool)
        self._row = 0
        self._speed = max(float(request.forward[0]), float(request.backward[0]))
        self.is_ready = False
        self.connects = False
        """Whether the goal's place can be reached by what is as wide as the outline's core."""

    def _extent(self, border: float) -> tuple[Array, Array]:
        """Corners (2,), (2,) of where a path may lead [m]."""
        request = self._request
        places = [request.start[None, :2], request.goal[None, :2]]
        low, high = (f(np.concatenate(places), axis=0) for f in (np.min, np.max))
        around = [request.circles[:, :2]]
        if request.solids is not None:
            around.append(request.solids.outermost * request.unit)
        points = np.concatenate([p for p in around if len(p)] or [np.empty((0, 2))])
        # what lies far from both is no way around
        far = 4.0 * border + float(np.hypot(*(high - low)))
        points = points[(np.abs(points - 0.5 * (low + high)) <= far).all(axis=1)]
        if len(points):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        return np.maximum(low - border, request.area[0]), np.minimum(high + border, request.area[1])

    def advance(self) -> int:
        """Do a part of it; return its work in quanta of 0.2 ms."""
        if self._row < self._rows:
            rows = np.arange(self._row, min(self._row + ROWS, self._rows))
            x = self._low[0] + self._cell * np.arange(self._columns)
            y = self._low[1] + self._cell * rows
            points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
            # a cell is free if a point in it may be
            least = self._request.distances(points) >= self._radius - 0.7 * self._cell
            self._free[rows] = least.reshape(len(rows), -1)
            self._row += len(rows)
            return 2
        self._search()
        return 20

    def _search(self) -> None:
        source = self._places(self._request.start[None])[0]
        ways = Ways(self._free, np.ones(self._free.shape), self._cell, int(source))
        self._distances = ways.cost
        goal = self._places(self._request.goal[None])[0]
        self.connects = bool(np.isfinite(self._distances[goal]))
        self.is_ready = True

    def _places(self, poses: Array) -> Array:
        """Numbers (...) of the cells of poses (..., 3); those outside count as at the edge."""
        cells = np.rint((poses[..., :2] - self._low) / self._cell).astype(np.intp)
        column = np.clip(cells[..., 0], 0, self._columns - 1)
        row = np.clip(cells[..., 1], 0, self._rows - 1)
        out: Array = row * self._columns + column
        return out

    def time_to(self, poses: Array) -> tuple[Array, Array]:
        """Least time (...) from the start to poses (..., 3) [s], and whether there is any (...)."""
        found = self._distances[self._places(poses)]
        low = self._low - self._cell
        high = self._low + self._cell * np.array((self._columns, self._rows))
        inside = ((poses[..., :2] >= low) & (poses[..., :2] <= high)).all(axis=-1)
        return np.maximum(found - self._cell, 0.0) / self._speed, inside & np.isfinite(found)
