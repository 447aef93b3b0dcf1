"""What it is compared with: a lattice search over what was seen, and pure pursuit of its path.

Which cells a lidar has seen is an account of its own: every beam is followed in small steps from
the scanner to where it ended.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.types import Array

STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))


class Pursuit:
    """Drives towards a point ahead on the shortest path through what is not known to be occupied.

    `radius`, `speed`, `turn_rate`: of the robot [m, m/s, rad/s]. `side`: of its area [m].
    """

    def __init__(self, radius: float, speed: float, turn_rate: float, side: float) -> None:
        self._radius, self._speed, self._turn_rate = radius, speed, turn_rate
        self._cell = radius / 3.0
        self._count = math.ceil(side / self._cell)
        self._low = -0.5 * side
        self._hits = np.zeros((self._count, self._count), dtype=bool)
        self._path: Array | None = None

    def command(self, pose: Array, goal: Array, ends: Array, tolerance: float) -> Array:
        """Command (2,) from a pose (3,), after a scan hit points (M, 2) in the world."""
        self._mark(ends)
        away = goal[:2] - pose[:2]
        if math.hypot(*away) < tolerance:
            return np.array([0.0, self._turn_to(goal[2] - pose[2])])
        if self._path is None or self._is_cut(pose):
            self._path = self._search(pose, goal)
        if self._path is None:
            return np.zeros(2)
        distances = np.hypot(*(self._path - pose[:2]).T)
        nearest = int(distances.argmin())
        ahead = np.flatnonzero(distances[nearest:] > 2.0 * self._radius)
        target = self._path[nearest + ahead[0]] if len(ahead) else goal[:2]
        bearing = math.atan2(*(target - pose[:2])[::-1]) - pose[2]
        bearing = math.remainder(bearing, math.tau)
        if abs(bearing) > 0.6:
            return np.array([0.0, self._turn_to(bearing)])
        distance = max(math.hypot(*(target - pose[:2])), 1e-9)
        curvature = 2.0 * math.sin(bearing) / distance
        speed = min(self._speed, self._turn_rate / max(abs(curvature), 1e-9))
        speed = min(speed, max(math.hypot(*away), 0.2 * self._speed))
        return np.array([speed, speed * curvature])

    def _turn_to(self, angle: float) -> float:
        return float(
            np.clip(3.0 * math.remainder(angle, math.tau), -self._turn_rate, self._turn_rate)
        )

    def _cells(self, points: Array) -> tuple[Array, Array]:
        place = np.floor((points - self._low) / self._cell).astype(int)
        place = np.clip(place, 0, self._count - 1)
        return place[:, 1], place[:, 0]

    def _mark(self, ends: Array) -> None:
        self._hits[self._cells(ends)] = True

    def _is_cut(self, pose: Array) -> bool:
        """Whether something stands on the path, or the robot has left it."""
        assert self._path is not None
        distances = np.hypot(*(self._path - pose[:2]).T)
        ahead = self._path[int(distances.argmin()) :]
        rows, columns = self._cells(ahead[:: max(1, len(ahead) // 200)])
        reach = math.ceil(self._radius / self._cell)
        near = ndimage.maximum_filter(self._hits, size=2 * reach + 1)
        return bool(near[rows, columns].any()) or float(distances.min()) > self._radius

    def _search(self, pose: Array, goal: Array) -> Array | None:
        """The shortest path (K, 2) that keeps the robot's radius, and some more where it can."""
        away = ndimage.distance_transform_edt(~self._hits) * self._cell
        start, end = (
            int(np.ravel_multi_index((r[0], c[0]), away.shape))
            for r, c in (self._cells(p[None, :2]) for p in (pose, goal))
        )
        for keep in (1.3, 1.15, 1.0):
            free = away >= keep * self._radius + 0.5 * self._cell
            free.ravel()[[start, end]] = True
            free |= away >= away.ravel()[start] - self._cell if keep == 1.0 else free
            cost, towards = _dijkstra(free, end)
            if np.isfinite(cost[start]):
                nodes = [start]
                while nodes[-1] != end:
                    nodes.append(int(towards[nodes[-1]]))
                row, column = np.unravel_index(nodes, free.shape)
                path: Array = self._low + self._cell * (np.stack([column, row], axis=1) + 0.5)
                return path
        return None


def cost_to_go(free: Array, goal: tuple[int, int]) -> Array:
    """Lengths in cells (R, C) of the shortest ways over free neighbours (R, C) to a cell.

    Infinite if there is none.
    """
    cost, _ = _dijkstra(free, int(np.ravel_multi_index(goal, free.shape)))
    return cost.reshape(free.shape)


def _dijkstra(free: Array, end: int) -> tuple[Array, Array]:
    """Lengths to a cell, and the next cell towards it, of each cell by its number."""
    number = np.arange(free.size).reshape(free.shape)
    tails, heads, lengths = [], [], []
    for dx, dy in STEPS:
        rows = slice(0, free.shape[0] - dx), slice(dx, None)
        columns = (slice(0, free.shape[1] - dy), slice(dy, None))
        if dy < 0:
            columns = slice(1, None), slice(0, -1)
        both = free[rows[0], columns[0]] & free[rows[1], columns[1]]
        tails.append(number[rows[0], columns[0]][both])
        heads.append(number[rows[1], columns[1]][both])
        lengths.append(np.full(len(tails[-1]), math.hypot(dx, dy)))
    graph = csr_matrix(
        (np.concatenate(lengths), (np.concatenate(tails), np.concatenate(heads))),
        (free.size, free.size),
    )
    cost, towards = dijkstra(graph, directed=False, indices=end, return_predecessors=True)
    return cost, towards


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
