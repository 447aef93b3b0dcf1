"""Ways through large grids: where they bend is found on a lattice, how they are driven on the graph of tangents.

A map from a lidar has hundreds of corners, and the graph of all their tangents is more than a step
can bear. The shortest way on a lattice tells which few of them a way touches. Distances on the
lattice and the search from a goal are kept while these stay.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Solids

FINEST, MOST_NODES = 0.05, 40_000
"""Least distance of the lattice's neighbours [m], and how many there are at the most."""
AROUND = 0.6
"""Room around all solids, robot and goal in which a way may lead [m]."""
CUT = 0.02
"""How deep a way may cut the inflated cells [m]; it keeps a clearance beyond what the robot must,
and the robot sees them exactly."""
SAMPLE = 0.04
"""Between the points of a line that are looked at [m]."""
AHEAD = 80
"""How many places of a route are looked at for the farthest in a straight line."""
MOST_SAMPLES = 400
KEPT = 4
"""Searches that are kept."""


class Lattice:
    """Distances of a map's solids on a lattice, and searches on it.

    Parameters
    ----------
    solids : Solids
        With at least one grid.
    """

    def __init__(self, solids: Solids) -> None:
        self._solids = solids
        self._low, self._high = np.zeros(2), np.zeros(2)
        self._searches: dict[tuple[object, ...], tuple[Array, NDArray[np.int32]]] = {}
        self._fields = []
        landmarks = []
        for boxes in solids.boxes:
            grid = boxes.grid
            pad = int(np.ceil(2.0 * AROUND / grid.resolution))
            cells = np.pad(grid.occupied, pad)
            self._fields.append(
                (
                    grid,
                    pad,
                    ndimage.distance_transform_edt(~cells, sampling=grid.resolution)
                    - 0.5 * grid.resolution,
                )
            )
            labels, count = ndimage.label(grid.occupied, np.ones((3, 3)))
            _, first = np.unique(labels, return_index=True)
            row, column = np.unravel_index(first[len(first) - count :], labels.shape)
            landmarks.append(grid.to_map(grid.resolution * (np.column_stack([column, row]) + 0.5)))
        self.landmarks = np.concatenate(landmarks)
        """(L, 2) a point in each of the grids' pieces that hang together [m]."""

    def _cover(self, *points: Array) -> None:
        """Lay the lattice so that it holds the solids and points (2,)."""
        corners = np.concatenate([self._solids.all_corners.points, *(p[None, :2] for p in points)])
        low, high = corners.min(axis=0) - AROUND, corners.max(axis=0) + AROUND
        if (low >= self._low).all() and (high <= self._high).all():
            return
        self._low, self._high = low, high
        self._searches.clear()
        size = self._high - self._low
        self._step = max(FINEST, float(np.sqrt(size.prod() / MOST_NODES)))
        self._shape = tuple(int(v) for v in np.ceil(size / self._step).astype(int) + 1)
        x, y = (self._low[i] + self._step * np.arange(self._shape[i]) for i in (0, 1))
        self._places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        distance = np.full(len(self._places), np.inf)
        for grid, pad, field in self._fields:
            at = grid.to_grid(self._places).T[::-1] / grid.resolution - 0.5 + pad
            np.minimum(
                distance, ndimage.map_coordinates(field, at, order=1, mode="nearest"), out=distance
            )
        if len(self._solids.outlines):
            np.minimum(
                distance, self._solids.outlines.distances(self._places)[0].min(axis=1), out=distance
            )
        self._distance = distance.reshape(self._shape)

    def route(
        self, start: Array, goal: Array, keep: float, circles: Array, area: Array
    ) -> LatticePath | None:
        """Find the shortest way on the lattice that keeps a distance [m] from all solids and from circles at rest.

        Parameters
        ----------
        start, goal : ndarray
            Points (2,), or poses.
        keep : float
            Distance from the solids' edges [m].
        circles : ndarray
            (M, 5); those that move are not looked at.
        area : ndarray
            xmin, ymin, xmax, ymax (4,).
        """
        self._cover(start, goal)
        still = circles[~circles[:, 3:].any(axis=1)]
        begin, end = self._node(start), self._node(goal)
        key = (end, keep, still.tobytes(), area.tobytes())
        if key not in self._searches:
            if len(self._searches) >= KEPT:
                del self._searches[next(iter(self._searches))]
            self._searches[key] = self._search(start, goal, keep, still, area)
        cost, towards = self._searches[key]
        if not np.isfinite(cost[begin]):
            return None
        nodes = [begin]
        while nodes[-1] != end:
            nodes.append(int(towards[nodes[-1]]))
        points = np.concatenate([start[None, :2], self._places[nodes[1:-1]], goal[None, :2]])
        return LatticePath(self, points, keep, min(self.room(start), self.room(goal)))

    def _node(self, point: Array) -> int:
        row, column = np.rint((point[:2] - self._low) / self._step).astype(int)
        return int(row * self._shape[1] + column)

    def _search(
        self, start: Array, goal: Array, keep: float, still: Array, area: Array
    ) -> tuple[Array, NDArray[np.int32]]:
        """Cost (n,) of every node to the goal [m], and the node that comes next (n,)."""
        distance = self._distance.ravel()
        for x, y, radius in still[:, :3]:
            distance = np.minimum(
                distance, np.hypot(self._places[:, 0] - x, self._places[:, 1] - y) - radius
            )
        free = (
            (distance >= keep)
            & (self._places >= area[:2]).all(axis=1)
            & (self._places <= area[2:]).all(axis=1)
        )
        # a robot may stand nearer to an obstacle than a way leads: from there outwards
        for point in (start, goal):
            near = np.hypot(*(self._places - point[:2]).T)
            room = distance[self._node(point)]
            free |= (
                (near <= 2.0 * keep) & (distance >= min(room - self._step, keep)) & (distance > 0.0)
            )
        grid = free.reshape(self._shape)
        number = np.arange(free.size).reshape(self._shape)
        tails, heads, lengths = [], [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            rows = slice(0, self._shape[0] - dx), slice(dx, None)
            columns = (
                (slice(0, self._shape[1] - dy), slice(dy, None))
                if dy >= 0
                else (slice(1, None), slice(0, -1))
            )
            here, there = (rows[0], columns[0]), (rows[1], columns[1])
            both = grid[here] & grid[there]
            tails.append(number[here][both])
            heads.append(number[there][both])
            lengths.append(np.full(len(tails[-1]), self._step * np.hypot(dx, dy)))
        tail, head, length = (np.concatenate(part) for part in (tails, heads, lengths))
        # in between, ways away from obstacles are no longer than those along them; they have more
        # room
        length *= 1.0 + 0.2 * np.maximum(1.0 - (distance[tail] - keep) / keep, 0.0)
        graph = csr_matrix((length, (tail, head)), (free.size, free.size))
        cost, towards = dijkstra(
            graph, directed=False, indices=self._node(goal), return_predecessors=True
        )
        return cost, towards

    def distances(self, points: Array) -> Array:
        """Distance (...) of points (..., 2) from the solids, between the lattice's nodes [m]."""
        place = (points - self._low) / self._step
        near = np.minimum(np.maximum(place.astype(int), 0), np.array(self._shape) - 2)
        x, y = np.moveaxis(place - near, -1, 0)
        i, j = np.moveaxis(near, -1, 0)
        field = self._distance
        found: Array = (1 - x) * ((1 - y) * field[i, j] + y * field[i, j + 1]) + x * (
            (1 - y) * field[i + 1, j] + y * field[i + 1, j + 1]
        )
        return found

    def lines_free(self, first: Array, last: Array, keep: float) -> Array:
        """Which lines from (T, 2) to (T, 2) keep a distance [m], but for `CUT` and the lattice's own accuracy."""
        if not len(first):
            return np.ones(0, dtype=bool)
        longest = float(np.abs(last - first).max())
        share = np.linspace(0.0, 1.0, min(2 + int(longest / SAMPLE), MOST_SAMPLES))[:, None, None]
        free: Array = np.all(
            self.distances(first + share * (last - first)) >= keep - max(CUT, 0.5 * self._step),
            axis=0,
        )
        return free

    def room(self, point: Array) -> float:
        """Exact distance of a point (2,) from the nearest solid [m]."""
        return float(self._solids.whole.least(point[None, :2])[0])

    def touched(self, points: Array) -> tuple[Array, Array]:
        """Exact distances (n,) of points (n, 2) from the nearest solid, and the points (n, 2) on its edge [m]."""
        distance, normals = self._solids.whole.measure(points)
        nearest = distance.argmin(axis=1)[:, None]
        gap, away = (
            np.take_along_axis(distance, nearest, 1)[:, 0],
            np.take_along_axis(normals, nearest[..., None], 1)[:, 0],
        )
        return gap, points - gap[:, None] * away


class LatticePath:
    """A way on the lattice, pulled straight, and what of the solids it touches.

    Parameters
    ----------
    maze : Maze
        Where.
    points : ndarray
        (n, 2) from start to goal [m].
    keep : float
        Distance from the solids [m].
    room : float
        Distance of start or goal from the solids, whichever is nearer [m].
    """

    def __init__(self, maze: Lattice, points: Array, keep: float, room: float) -> None:
        self._maze, self._keep = maze, keep
        bends = [0]
        while bends[-1] < len(points) - 1:
            ahead = np.arange(bends[-1] + 1, min(bends[-1] + AHEAD, len(points)))
            seen = maze.lines_free(
                np.repeat(points[bends[-1] : bends[-1] + 1], len(ahead), axis=0),
                points[ahead],
                keep,
            )
            bends.append(int(ahead[np.flatnonzero(seen)[-1]] if seen.any() else ahead[0]))
        self.points = points[bends]
        """(K, 2) [m]."""
        self.radius = max(min(keep, room - 1e-3), 0.0)
        """Distance that the way keeps from the solids [m]: `keep`, where start and goal do."""
        self.corners = maze.touched(self.points[1:-1])[1] if len(bends) > 2 else np.empty((0, 2))
        """(C, 2) points on the edges of solids that the way goes around [m]."""

    def lines_free(self, first: Array, last: Array) -> Array:
        """Which lines from (T, 2) to (T, 2) cut no solid, (T,)."""
        return self._maze.lines_free(first, last, self.radius)

    def cut(self, points: Array) -> Array:
        """Points (C, 2) on the edges of solids that a line through points (K, 2) comes too near to, one for each time [m]."""
        lengths = np.hypot(*np.diff(points, axis=0).T)
        along = np.append(0.0, np.cumsum(lengths))
        places = np.arange(0.0, along[-1], SAMPLE)
        dense = np.column_stack([np.interp(places, along, points[:, i]) for i in (0, 1)])
        # the lattice tells where to look
        close = np.flatnonzero(self._maze.distances(dense) < self.radius + SAMPLE)
        if not len(close):
            return np.empty((0, 2))
        gap, edge = self._maze.touched(dense[close])
        inside = gap < self.radius - CUT
        pieces = np.split(
            np.arange(len(close)), np.flatnonzero((np.diff(close) > 1) | np.diff(inside)) + 1
        )
        deepest = [piece[np.argmin(gap[piece])] for piece in pieces if inside[piece[0]]]
        return edge[deepest]
