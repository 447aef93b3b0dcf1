"""Which cells of a world the lidar has seen: an account of its own, without the controller's code.

Every beam is followed in small steps from the scanner to where it ended.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.types import Array


class SeenCells:
    """Cells of a square area, each seen or never.

    `side`: of the area [m]. `radius`: of the robot [m].
    """

    def __init__(self, side: float, radius: float) -> None:
        self._radius, self._cell = radius, radius / 3.0
        border = 2.0 * radius
        self._low = -0.5 * side - border
        count = math.ceil((side + 2.0 * border) / self._cell)
        self._seen = np.zeros((count, count), dtype=bool)

    def look(self, pose: Array, ranges: Array, directions: Array, reach: float) -> None:
        """Follow the beams of a scan, and the robot's own place."""
        self._seen[self._around(pose[None, :2], self._radius + self._cell)] = True
        known = ~np.isnan(ranges) & (ranges > 0.0)
        ends = np.minimum(ranges[known], reach)
        along = pose[2] + directions[known]
        steps = np.arange(0.0, reach, 0.25 * self._cell)
        beam, step = np.nonzero(steps < ends[:, None])
        x = pose[0] + steps[step] * np.cos(along[beam])
        y = pose[1] + steps[step] * np.sin(along[beam])
        self._seen[self._place(np.stack([x, y], axis=1))] = True

    def enters_unseen(self, places: Array, pose: Array) -> bool:
        """Whether a robot that drives through places (T, 2) covers the middle of an unseen cell.

        Cells that it covers where it stands (3,) do not count.
        """
        seen = self._seen.copy()
        seen[self._around(pose[None, :2], self._radius)] = True
        return not bool(seen[self._around(places, self._radius - self._cell)].all())

    def _around(self, places: Array, reach: float) -> tuple[Array, Array]:
        """Cells whose middles lie within a reach of any of places (T, 2)."""
        count = math.ceil(reach / self._cell) + 1
        steps = np.arange(-count, count + 1)
        rows, columns = self._place(places)
        row = rows[:, None, None] + steps[:, None]
        column = columns[:, None, None] + steps
        away_x = self._low + (column + 0.5) * self._cell - places[:, 0, None, None]
        away_y = self._low + (row + 0.5) * self._cell - places[:, 1, None, None]
        near = np.hypot(away_x, away_y) <= reach
        most = len(self._seen) - 1
        row, column = np.broadcast_arrays(row, column)
        return np.clip(row[near], 0, most), np.clip(column[near], 0, most)

    def _place(self, points: Array) -> tuple[Array, Array]:
        """Rows and columns of the cells of points (n, 2)."""
        place = np.floor((points - self._low) / self._cell).astype(int)
        place = np.clip(place, 0, len(self._seen) - 1)
        return place[:, 1], place[:, 0]
