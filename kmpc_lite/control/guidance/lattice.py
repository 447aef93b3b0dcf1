"""Paths through large grids: a lattice tells where they bend, and the tangent graph the rest.

A map from a lidar has hundreds of corners, and the graph of all their tangents is more than a step
can bear. The shortest path on a lattice tells which few of them a path touches. Distances on the
lattice and the search from a goal are kept while these stay.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.control.guidance.lattice_path import LatticePath
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.occupancy import OccupancyGrid
    from kmpc_lite.control.obstacles.solids import Solids

PORTION = 2**18
"""Nodes times edges that are looked at at once: a matter of memory alone."""
NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Half of a node's neighbours: the others have it for theirs."""


class Lattice:
    """Distances of a map's solids on a lattice, and searches on it.

    Parameters
    ----------
    solids : Solids
        With at least one grid.
    options : GuidanceOptions
        In metres.
    """

    def __init__(self, solids: Solids, options: GuidanceOptions) -> None:
        self._solids, self.options = solids, options
        self._low, self._high = np.zeros(2), np.zeros(2)
        self._searches: dict[tuple[object, ...], tuple[Array, NDArray[np.int32]]] = {}
        grids = [boxes.grid for boxes in solids.boxes]
        self._fields = [self._field(grid) for grid in grids]
        self.landmarks = np.concatenate([_landmarks(grid, self._joined(grid)) for grid in grids])
        """(L, 2) a point in each of the grids' pieces that hang together [m]."""

    def _field(self, grid: OccupancyGrid) -> tuple[OccupancyGrid, int, Array]:
        """A grid, the cells laid around it, and distances of the cells from occupied ones [m]."""
        side = self._joined(grid) * grid.resolution
        border = math.ceil(2.0 * self.options.lattice_border / side)
        cells = np.pad(_blocks(grid.occupied, self._joined(grid)), border)
        distance = ndimage.distance_transform_edt(~cells, sampling=side)
        return grid, border, distance - 0.5 * side

    def _joined(self, grid: OccupancyGrid) -> int:
        """How many cells of a grid, along each axis, make one cell of its field.

        More than one where they are finer than half a step of the lattice, or would be too many.
        """
        o = self.options
        size = grid.resolution * np.array(grid.occupied.shape) + 4.0 * o.lattice_border
        least = math.sqrt(float(size.prod()) / o.lattice_field_cells)
        fine = int(0.5 * o.lattice_step / grid.resolution + 1e-9)
        return max(1, fine, math.ceil(least / grid.resolution - 1e-9))

    def cover(self, *points: Array) -> None:
        """Lay the lattice so that it holds the solids and points (2,)."""
        border = self.options.lattice_border
        corners = np.concatenate([self._solids.outermost, *(p[None, :2] for p in points)])
        low, high = corners.min(axis=0) - border, corners.max(axis=0) + border
        if (low >= self._low).all() and (high <= self._high).all():
            return
        self._low, self._high = low, high
        self._searches.clear()
        size = self._high - self._low
        coarse = float(np.sqrt(size.prod() / self.options.lattice_nodes))
        self.step = max(self.options.lattice_step, coarse)
        self._shape = tuple(int(v) for v in np.ceil(size / self.step).astype(int) + 1)
        x, y = (self._low[i] + self.step * np.arange(self._shape[i]) for i in (0, 1))
        self._places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        distance = np.full(len(self._places), np.inf)
        for grid, pad, field in self._fields:
            side = self._joined(grid) * grid.resolution
            at = grid.to_grid(self._places).T[::-1] / side - 0.5 + pad
            near = ndimage.map_coordinates(field, at, order=1, mode="nearest")
            np.minimum(distance, near, out=distance)
        for outlines in self._solids.outlines.walls_and_polygons():
            portion = max(PORTION // outlines.edge_count, 1)
            for begin in range(0, len(distance), portion):
                some = slice(begin, begin + portion)
                near = outlines.distances(self._places[some])[0].min(axis=1)
                np.minimum(distance[some], near, out=distance[some])
        self._distance = distance.reshape(self._shape)

    def path(
        self, start: Array, goal: Array, inflation: float, circles: Array, area: Array
    ) -> LatticePath | None:
        """Find the shortest path that keeps a distance from all solids and from circles at rest.

        Parameters
        ----------
        start, goal : ndarray
            Points (2,), or poses.
        inflation : float
            Distance from the solids' edges [m].
        circles : ndarray
            (M, 5); those that move are not looked at.
        area : ndarray
            xmin, ymin, xmax, ymax (4,).
        """
        self.cover(start, goal)
        still = circles[~circles[:, 3:].any(axis=1)]
        begin, end = self._node(start), self._node(goal)
        key = (end, inflation, still.tobytes(), area.tobytes())
        if key not in self._searches:
            if len(self._searches) >= self.options.lattice_searches:
                del self._searches[next(iter(self._searches))]
            self._searches[key] = self._search(start, goal, inflation, still, area)
        cost, towards = self._searches[key]
        if not np.isfinite(cost[begin]):
            return None
        nodes = [begin]
        while nodes[-1] != end:
            nodes.append(int(towards[nodes[-1]]))
        points = np.concatenate([start[None, :2], self._places[nodes[1:-1]], goal[None, :2]])
        return LatticePath(
            self, points, inflation, min(self.clearance(start), self.clearance(goal))
        )

    def _node(self, point: Array) -> int:
        row, column = np.rint((point[:2] - self._low) / self.step).astype(int)
        return int(row * self._shape[1] + column)

    def _search(
        self, start: Array, goal: Array, inflation: float, still: Array, area: Array
    ) -> tuple[Array, NDArray[np.int32]]:
        """Cost (n,) of every node to the goal [m], and the node that comes next (n,)."""
        distance = self._distance.copy()
        places = self._places.reshape(*self._shape, 2)
        for x, y, radius in still[:, :3]:
            # farther away it changes nothing of what follows
            reach = radius + 2.0 * inflation + 2.0 * self.step
            low = np.maximum((np.array([x, y]) - reach - self._low) / self.step, 0.0).astype(int)
            high = np.maximum((np.array([x, y]) + reach - self._low) / self.step + 2.0, 0.0)
            some = slice(low[0], int(high[0])), slice(low[1], int(high[1]))
            away = np.hypot(places[some][..., 0] - x, places[some][..., 1] - y) - radius
            np.minimum(distance[some], away, out=distance[some])
        distance = distance.ravel()
        free = distance >= inflation
        free &= (self._places >= area[:2]).all(axis=1) & (self._places <= area[2:]).all(axis=1)
        # a robot may stand nearer to an obstacle than a path leads: from there outwards
        for point in (start, goal):
            near = np.hypot(*(self._places - point[:2]).T) <= 2.0 * inflation
            allowed = min(float(distance[self._node(point)]) - self.step, inflation)
            free |= near & (distance >= allowed) & (distance > 0.0)
        tail, head, length = self._links(free.reshape(self._shape))
        # between obstacles, paths away from them are no longer than those along them, and better
        near = np.maximum(1.0 - (distance[tail] - inflation) / inflation, 0.0)
        length *= 1.0 + self.options.lattice_near_cost * near
        graph = csr_matrix((length, (tail, head)), (free.size, free.size))
        cost, towards = dijkstra(
            graph, directed=False, indices=self._node(goal), return_predecessors=True
        )
        return cost, towards

    def _links(self, free: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Nodes (E,), their free neighbours (E,), and the distances between them (E,) [m]."""
        number = np.arange(free.size).reshape(free.shape)
        tails, heads, lengths = [], [], []
        for dx, dy in NEIGHBOURS:
            rows = slice(0, free.shape[0] - dx), slice(dx, None)
            if dy >= 0:
                columns = slice(0, free.shape[1] - dy), slice(dy, None)
            else:
                columns = slice(1, None), slice(0, -1)
            here, there = (rows[0], columns[0]), (rows[1], columns[1])
            both = free[here] & free[there]
            tails.append(number[here][both])
            heads.append(number[there][both])
            lengths.append(np.full(len(tails[-1]), self.step * np.hypot(dx, dy)))
        return np.concatenate(tails), np.concatenate(heads), np.concatenate(lengths)

    def distances(self, points: Array) -> Array:
        """Distance (...) of points (..., 2) from the solids, between the lattice's nodes [m]."""
        place = (points - self._low) / self.step
        near = np.minimum(np.maximum(place.astype(int), 0), np.array(self._shape) - 2)
        x, y = np.moveaxis(place - near, -1, 0)
        i, j = np.moveaxis(near, -1, 0)
        field = self._distance
        found: Array = (1 - x) * ((1 - y) * field[i, j] + y * field[i, j + 1]) + x * (
            (1 - y) * field[i + 1, j] + y * field[i + 1, j + 1]
        )
        return found

    def lines_free(self, first: Array, last: Array, inflation: float) -> Array:
        """Which lines (T,) from (T, 2) to (T, 2) keep a distance [m].

        They may come nearer by `lattice_cut`, or by half a step of the lattice if that is larger.
        """
        if not len(first):
            return np.ones(0, dtype=bool)
        o = self.options
        longest = float(np.abs(last - first).max())
        samples = min(2 + int(longest / o.lattice_sample), o.lattice_samples)
        along = np.linspace(0.0, 1.0, samples)[:, None, None]
        distances = self.distances(first + along * (last - first))
        free: Array = np.all(distances >= inflation - max(o.lattice_cut, 0.5 * self.step), axis=0)
        return free

    def clearance(self, point: Array) -> float:
        """Exact distance of a point (2,) from the nearest solid [m]."""
        return float(self._solids.whole.least(point[None, :2])[0])

    def touched(self, points: Array) -> tuple[Array, Array]:
        """Distances (n,) of points (n, 2) from the nearest solid, and its edge there (n, 2) [m]."""
        distance, normals = self._solids.whole.measure(points)
        nearest = distance.argmin(axis=1)[:, None]
        least = np.take_along_axis(distance, nearest, 1)[:, 0]
        away = np.take_along_axis(normals, nearest[..., None], 1)[:, 0]
        return least, points - least[:, None] * away


def _blocks(occupied: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Blocks of so many cells a side, occupied where a cell of theirs is."""
    if side == 1:
        return occupied
    rows, columns = (np.arange(0, length, side) for length in occupied.shape)
    return np.logical_or.reduceat(np.logical_or.reduceat(occupied, rows, axis=0), columns, axis=1)


def _landmarks(grid: OccupancyGrid, joined: int) -> Array:
    """A point (L, 2) in each piece of the occupied blocks of cells that hangs together [m]."""
    labels, pieces = ndimage.label(_blocks(grid.occupied, joined), np.ones((3, 3)))
    _, first = np.unique(labels, return_index=True)
    row, column = np.unravel_index(first[len(first) - pieces :], labels.shape)
    return grid.to_map(joined * grid.resolution * (np.column_stack([column, row]) + 0.5))
