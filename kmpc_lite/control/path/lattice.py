"""Paths through large grids: a lattice tells where they bend, and the tangent graph the rest.

A map from a lidar has hundreds of corners, and the graph of all their tangents is more than a step
can bear. The shortest path on a lattice tells which few of them a path touches. Distances on the
lattice and the search from a goal are kept while these stay.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.control.path.grid_field import LATTICE_BORDER, GridField
from kmpc_lite.control.path.lattice_path import LATTICE_CUT, LATTICE_SAMPLE, LatticePath
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids

LATTICE_NEAR_COST = 0.2
"""A step along an obstacle counts as longer than one in the open, by this share: paths keep in the
middle between two obstacles."""
LATTICE_SAMPLES = 400
"""Most of these points on one line."""
LATTICE_SEARCHES = 4
"""Most goals for which the lattice keeps its search, to find the next path to them at once."""

EVERYWHERE = np.full(2, -np.inf), np.full(2, np.inf)
PORTION = 2**18
"""Nodes times edges that are looked at at once: a matter of memory alone."""
NEIGHBOURS = ((0, 1), (1, -1), (1, 0), (1, 1))
"""Half of a node's neighbours, by their numbers: the others have it for theirs."""
COARSE = 8
"""Every so many points of a line are looked at first: most lines that are barred are so there."""


class Fineness(NamedTuple):
    """Of a lattice."""

    step: float
    """Least distance between neighbours [m]."""
    nodes: int
    """Most nodes: larger maps get wider steps."""


FINE = Fineness(0.05, 40_000)
"""A third of a radius, and what memory and a few steps of searching allow."""


class LatticeTask(NamedTuple):
    """Between what, and how far from what, a path on a lattice is looked for."""

    start: Array
    """Pose (3,)."""
    goal: Array
    """Pose (3,)."""
    inflation: float
    """Distance from the edges of solids and circles [m]."""
    circles: Array
    """(K, 5), at rest."""
    area: Array
    """xmin, ymin, xmax, ymax (4,)."""


class Search(NamedTuple):
    """Of the whole lattice, from a goal."""

    cost: Array
    """(n,) of every node to the goal [m]; infinite if no way is known."""
    towards: NDArray[np.int32]
    """(n,) the node that comes next."""


class Lattice:
    """Distances of a map's solids on a lattice, and searches on it.

    Parameters
    ----------
    solids : Solids
        With at least one grid.
    limits : tuple of ndarray, optional
        Corners (2,), (2,) of the area that paths lie in; only start and goal may lie outside [m].
    """

    def __init__(
        self,
        solids: Solids,
        limits: tuple[Array, Array] | None = None,
        fineness: Fineness = FINE,
    ) -> None:
        self.solids, self._fineness = solids, fineness
        self._limits = EVERYWHERE if limits is None else limits
        self._low, self._high = np.zeros(2), np.zeros(2)
        corners = solids.outermost
        self._corners = corners.min(axis=0), corners.max(axis=0)
        self._searches: dict[tuple[object, ...], Search] = {}
        self._fields = [GridField(b.grid, fineness.step, self._limits) for b in solids.boxes]
        self.landmarks = np.concatenate([field.landmarks for field in self._fields])
        """(L, 2) a point in each of the grids' pieces that hang together [m]."""

    def cover(self, *points: Array) -> None:
        """Lay the lattice so that it holds the solids and points (2,), unless it lies so."""
        border = LATTICE_BORDER
        ends = np.stack([p[:2] for p in points])
        first, last = ends.min(axis=0), ends.max(axis=0)
        low = np.maximum(np.minimum(self._corners[0], first) - border, self._limits[0])
        high = np.minimum(np.maximum(self._corners[1], last) + border, self._limits[1])
        low, high = np.minimum(low, first), np.maximum(high, last)
        if (low == self._low).all() and (high == self._high).all():
            return
        self._low, self._high = low, high
        self._searches.clear()
        size = self._high - self._low
        coarse = float(np.sqrt(size.prod() / self._fineness.nodes))
        self.step = max(self._fineness.step, coarse)
        self._shape = tuple(int(v) for v in np.ceil(size / self.step).astype(int) + 1)
        axes = [self._low[i] + self.step * np.arange(self._shape[i]) for i in (0, 1)]
        self._axes, self._places = axes, np.empty((*self._shape, 2))
        self._places[..., 0], self._places[..., 1] = axes[0][:, None], axes[1]
        self._places = self._places.reshape(-1, 2)
        distance = np.full(len(self._places), np.inf)
        for field in self._fields:
            np.minimum(distance, field.distances(self._places), out=distance)
        for outlines in self.solids.outlines.walls_and_polygons():
            portion = max(PORTION // outlines.edge_count, 1)
            for begin in range(0, len(distance), portion):
                some = slice(begin, begin + portion)
                near = outlines.distances(self._places[some])[0].min(axis=1)
                np.minimum(distance[some], near, out=distance[some])
        self._distance = distance.reshape(self._shape)

    def search(
        self, task: LatticeTask, quanta: int = 1
    ) -> Generator[int, None, LatticePath | None]:
        """Find the shortest path in three parts of so many quanta, of which one is yielded each.

        Searches from a goal are kept, to find the next path to it at once.
        """
        self.cover(task.start, task.goal)
        key = self._key(task)
        graph = None if key in self._searches else self._graph(task)
        yield quanta
        if graph is not None:
            if len(self._searches) >= LATTICE_SEARCHES:
                del self._searches[next(iter(self._searches))]
            goal = self._node(task.goal)
            self._searches[key] = Search(
                *dijkstra(graph, directed=False, indices=goal, return_predecessors=True)
            )
        yield quanta
        path = self._path(task, self._searches[key])
        yield 1
        return path

    def _path(self, task: LatticeTask, search: Search) -> LatticePath | None:
        """The path from the start, pulled straight; None if there is none."""
        begin, end = self._node(task.start), self._node(task.goal)
        if not np.isfinite(search.cost[begin]):
            return None
        nodes = [begin]
        while nodes[-1] != end:
            nodes.append(int(search.towards[nodes[-1]]))
        start, goal = task.start[None, :2], task.goal[None, :2]
        points = np.concatenate([start, self._places[nodes[1:-1]], goal])
        ends = min(self.clearance(task.start), self.clearance(task.goal))
        return LatticePath(self, points, task.inflation, ends)

    def _key(self, task: LatticeTask) -> tuple[object, ...]:
        """All that a search depends on: a start only where it is nearer than paths lead."""
        start, circles = self._node(task.start), task.circles
        away = np.hypot(*(circles[:, :2] - task.start[:2]).T) - circles[:, 2]
        around = min(self._distance.item(start), away.min(initial=np.inf))
        needed = start if around < task.inflation + 2.0 * self.step else None
        places = self._node(task.goal), needed
        return (*places, task.inflation, circles.tobytes(), task.area.tobytes())

    def _node(self, point: Array) -> int:
        row, column = np.rint((point[:2] - self._low) / self.step).astype(int)
        return int(row * self._shape[1] + column)

    def _graph(self, task: LatticeTask) -> csr_matrix:
        """Links between the nodes that keep the distance."""
        start, goal, inflation, still, area = task
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
        free = (distance >= inflation).reshape(self._shape)
        inside = (self._places >= area[:2]) & (self._places <= area[2:])
        free &= inside.all(axis=1).reshape(self._shape)
        # a robot may stand nearer to an obstacle than a path leads: from there outwards
        for point in (start, goal):
            x, y = self._axes[0] - point[0], self._axes[1] - point[1]
            reach = 2.0 * inflation
            rows = slice(*np.searchsorted(x, (-reach, reach + self.step)))
            columns = slice(*np.searchsorted(y, (-reach, reach + self.step)))
            some = rows, columns
            near = np.hypot(x[rows, None], y[columns]) <= reach
            allowed = min(float(distance[self._node(point)]) - self.step, inflation)
            around = distance.reshape(self._shape)[some]
            free[some] |= near & (around >= allowed) & (around > 0.0)
        # between obstacles, paths away from them are no longer than those along them, and better
        near = np.maximum(1.0 - (distance - inflation) / inflation, 0.0)
        return linked(free, 1.0 + LATTICE_NEAR_COST * near, self.step)

    def distances(self, points: Array) -> Array:
        """Distance (...) of points (..., 2) from the solids, between the lattice's nodes [m]."""
        (height, width), field = self._shape, self._distance.ravel()
        place = (points - self._low) / self.step
        near = np.minimum(np.maximum(place.astype(np.intp), 0), (height - 2, width - 2))
        x, y = (place - near)[..., 0], (place - near)[..., 1]
        at = near[..., 0] * width + near[..., 1]
        low = (1 - y) * field.take(at) + y * field.take(at + 1)
        high = (1 - y) * field.take(at + width) + y * field.take(at + width + 1)
        found: Array = (1 - x) * low + x * high
        return found

    def lines_free(self, first: Array, last: Array, inflation: float) -> Array:
        """Which lines (T,) from (T, 2) to (T, 2) keep a distance [m].

        They may come nearer by `lattice_cut`, or by half a step of the lattice if that is larger.
        """
        if not len(first):
            return np.ones(0, dtype=bool)
        longest = float(np.abs(last - first).max())
        samples = min(2 + int(longest / LATTICE_SAMPLE), LATTICE_SAMPLES)
        along = np.linspace(0.0, 1.0, samples)[:, None, None]
        least = inflation - max(LATTICE_CUT, 0.5 * self.step)
        free = np.ones(len(first), dtype=bool)
        for some in (along[::COARSE], along):
            look = np.flatnonzero(free)
            begin = first[look]
            distances = self.distances(begin + some * (last[look] - begin))
            free[look] = (distances >= least).all(axis=0)
        return free

    def clearance(self, point: Array) -> float:
        """Exact distance of a point (2,) from the nearest solid [m]."""
        return float(self.solids.whole.least(point[None, :2])[0])

    def touched(self, points: Array) -> tuple[Array, Array]:
        """Distances (n,) of points (n, 2) from the nearest solid, and its edge there (n, 2) [m]."""
        distance, normals = self.solids.whole.measure(points)
        nearest = distance.argmin(axis=1)[:, None]
        least = np.take_along_axis(distance, nearest, 1)[:, 0]
        away = np.take_along_axis(normals, nearest[..., None], 1)[:, 0]
        return least, points - least[:, None] * away


def linked(free: NDArray[np.bool_], cost: Array, step: float) -> csr_matrix:
    """Graph of the eight ways between free nodes of a grid (H, W), a step apart along its axes.

    Each is as long as the cost (H, W) of its first node makes it.
    """
    height, width = free.shape
    links = np.zeros((height, width, len(NEIGHBOURS)), dtype=bool)
    for i, (dx, dy) in enumerate(NEIGHBOURS):
        left, right = max(-dy, 0), width - max(dy, 0)
        here = free[: height - dx, left:right]
        links[: height - dx, left:right, i] = here & free[dx:, left + dy : right + dy]
    begins = np.zeros(free.size + 1, dtype=np.int32)
    np.cumsum(links.sum(axis=2, dtype=np.int32), out=begins[1:])
    linked = np.flatnonzero(links)
    tail = linked // len(NEIGHBOURS)
    kind = linked - len(NEIGHBOURS) * tail
    down, right = np.array(NEIGHBOURS).T
    head = (tail + (down * width + right).take(kind)).astype(np.int32)
    lengths = (step * np.hypot(down, right)).take(kind) * cost.take(tail)
    return csr_matrix((lengths, head, begins), (free.size, free.size))
