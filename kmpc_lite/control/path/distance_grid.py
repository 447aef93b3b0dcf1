"""Distances from what is in the way on the nodes of a grid, and the shortest ways on it to a goal.

It tells on which sides of the obstacles a path leads; how it leads there exactly, a taut string
does (`taut_string`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from kmpc_lite.control.kernels import library
from kmpc_lite.control.path.planner import ROUNDING, PathRequest
from kmpc_lite.control.world.solids import Solids, same_solids
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.occupancy import OccupancyGrid

BORDER = 0.6  # how far a path may lead around the outermost obstacle, start or goal [m]
NEAR_COST = 0.2
"""A way along an obstacle counts as longer than one in the open, by this share: paths keep in the
middle between two obstacles."""
CUT = 0.005
"""How much nearer than asked lines may lead past obstacles: the nodes tell distances so well [m].
"""
BESIDE = 0.7  # room is looked for beside nodes that are too near by less than so many steps, ...
NEAREST = 0.25  # ... and by less than this share of the distance that is kept.
SAMPLE = 0.04  # a line is looked at in points that lie so far apart [m]
COARSE = 8
"""Every so many points of a line are looked at first: most lines that are barred are so there."""
FIELD_CELLS = 1_000_000
"""Most cells of a map for which the distance to the nearest obstacle is worked out. Cells of a
larger or finer one are joined to blocks, which count as occupied where one of their cells is."""
STRIP, QUANTUM = 16, 2**17
"""Quanta of a part of what a grid sees; nodes, or points of a line, times edges and circles that
are looked at in a quantum of a search, 0.2 ms."""
NODES, SEEN_NODES = 40_000, 12_000
"""Most nodes, beyond which steps are wider: what memory and a few steps of searching allow; and
among what scans show, which is looked at anew all the time."""
FAR = 1e3  # distance from what is farther than this, or not there at all [m]


class Extent(NamedTuple):
    """Of a grid."""

    step: float  # least distance between neighbours [m]
    around: float
    """Obstacles farther than this from the middle between start and goal make it no larger [m]."""
    border: float = BORDER  # how far it reaches around the outermost of these [m]


class DistanceGrid:
    """Distances of nodes from the circles and solids of a request, once `see` has come to its end.

    `request`: start, goal, obstacles and area. `extent`: of the nodes. `fields`: of the occupancy
    grids among the solids.
    """

    def __init__(self, request: PathRequest, extent: Extent, fields: Iterable[MapField]) -> None:
        self._request, solids = request, request.solids
        ends = np.stack([request.start[:2], request.goal[:2]])
        circles = request.circles
        centres, radii = circles[:, :2], circles[:, 2:3]
        around = [] if solids is None else [solids.outermost]
        points = np.concatenate([centres - radii, centres + radii, *around])
        near = (np.abs(points - ends.mean(axis=0)) <= extent.around).all(axis=1)
        self.is_whole = bool(near.all())  # whether all obstacles lie on it
        points = np.concatenate([ends, points[near]])
        low, high = points.min(axis=0) - extent.border, points.max(axis=0) + extent.border
        # only start and goal may lie outside the area
        low, high = np.maximum(low, request.area[0]), np.minimum(high, request.area[1])
        self.low, high = np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))
        size = high - self.low
        nodes = NODES if request.known is None else SEEN_NODES
        self.step = max(extent.step, math.sqrt(float(size.prod()) / nodes))
        self.shape = tuple(int(v) for v in np.ceil(size / self.step).astype(int) + 1)
        self._axes = [self.low[i] + self.step * np.arange(self.shape[i]) for i in (0, 1)]
        places = np.empty((*self.shape, 2))
        places[..., 0], places[..., 1] = self._axes[0][:, None], self._axes[1]
        self.places = places.reshape(-1, 2)
        distance = np.full(len(self.places), FAR)
        for field in fields:
            np.minimum(distance, field.distances(self.places), out=distance)
        self.distance = distance.reshape(self.shape)

    def see(self, width: int = 0, least: int = 0) -> Iterator[int]:
        """See circles, polygons and walls, too, strip by strip: the quanta of each come before it.

        `width`: in nodes; what `STRIP` quanta allow if not given. `least`: quanta of any strip.
        """
        request, columns = self._request, self.shape[1]
        solids = request.solids
        outlines = 0 if solids is None else solids.outlines.edge_count
        quanta = self.distance.size * (outlines + len(request.circles)) / QUANTUM
        width = width or math.ceil(columns * STRIP / max(quanta, STRIP))
        for begin in range(0, columns, width):
            if begin or least:
                yield max(int(quanta * width / columns), least)
            strip = slice(begin, begin + width)
            distance, y = self.distance[:, strip], self._axes[1][strip]
            for cx, cy, radius in request.circles[:, :3].tolist():
                away = np.hypot(self._axes[0][:, None] - cx, y - cy) - radius
                np.minimum(distance, away, out=distance)
            if outlines and solids is not None:
                places = self.places.reshape(*self.shape, 2)[:, strip].reshape(-1, 2)
                near = solids.whole.least(places, maps=False).reshape(distance.shape)
                np.minimum(distance, near, out=distance)

    def node(self, point: Array) -> int:
        """Number of the node nearest to a point (2,)."""
        row, column = np.rint((point[:2] - self.low) / self.step).astype(int)
        return int(row * self.shape[1] + column)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Which points (n, 2) lie on the grid."""
        high = self.low + self.step * (np.array(self.shape) - 1)
        held: NDArray[np.bool_] = ((points >= self.low) & (points <= high)).all(axis=1)
        return held

    def free(self, kept: float) -> tuple[NDArray[np.bool_], Array]:
        """Nodes (H, W) that keep a distance [m] from what is in the way, and their places (H W, 2).

        Nodes that are a little too near keep it where there is room beside them: passages are
        hardly wider than that, and lie between nodes. At start and goal, where the robot may stand
        nearer than a path leads, nodes are free from there outwards.
        """
        request, places, distance = self._request, self.places.copy(), self.distance.ravel().copy()
        # what scans show is known no better than that
        deep = min(BESIDE * self.step, NEAREST * kept) if request.known is None else 0.0
        near = np.flatnonzero((distance < kept) & (distance >= kept - deep))
        if len(near):
            beside = request.nearest(places[near])
            places[near] += (kept - beside.gap)[:, None] * beside.away
            distance[near] = np.maximum(distance[near], request.distances(places[near]) + ROUNDING)
        distance = distance.reshape(self.shape)
        free = distance >= kept
        for axis, at in enumerate(self._axes):
            inside = (at >= request.area[0, axis]) & (at <= request.area[1, axis])
            free &= inside[:, None] if axis == 0 else inside
        for point in (request.start, request.goal):
            x, y = self._axes[0] - point[0], self._axes[1] - point[1]
            reach = 2.0 * kept
            rows = slice(*np.searchsorted(x, (-reach, reach + self.step)))
            columns = slice(*np.searchsorted(y, (-reach, reach + self.step)))
            close = np.hypot(x[rows, None], y[columns]) <= reach
            allowed = min(float(distance.ravel()[self.node(point)]) - self.step, kept)
            around = distance[rows, columns]
            free[rows, columns] |= close & (around >= allowed) & (around > 0.0)
        return free, places

    def costs(self, kept: float) -> Array:
        """How many times its length a way by each node (H, W) counts that keeps a distance [m]."""
        return 1.0 + NEAR_COST * np.clip(2.0 - self.distance / kept, 0.0, 1.0)

    def distances(self, points: Array) -> Array:
        """Distance (...) of points (..., 2), between the nodes [m]."""
        (height, width), field = self.shape, self.distance.ravel()
        place = (points - self.low) / self.step
        near = np.minimum(np.maximum(place.astype(np.intp), 0), (height - 2, width - 2))
        x, y = (place - near)[..., 0], (place - near)[..., 1]
        at = near[..., 0] * width + near[..., 1]
        low = (1 - y) * field.take(at) + y * field.take(at + 1)
        high = (1 - y) * field.take(at + width) + y * field.take(at + width + 1)
        found: Array = (1 - x) * low + x * high
        return found

    def lines_free(self, first: Array, last: Array, kept: float) -> NDArray[np.bool_]:
        """Which lines (T,) from (T, 2) to (T, 2) keep a distance [m], but for `CUT`."""
        longest = float(np.abs(last - first).max(initial=0.0))
        samples = 2 + int(longest / self.step)
        along = np.linspace(0.0, 1.0, samples)[:, None, None]
        least = kept - CUT
        free = np.ones(len(first), dtype=bool)
        for some in (along[::COARSE], along):
            look = np.flatnonzero(free)
            begin = first[look]
            distances = self.distances(begin + some * (last[look] - begin))
            free[look] = (distances >= least).all(axis=0)
        return free


class MapFields:
    """Distances from the maps among solids, kept while these are the same."""

    def __init__(self) -> None:
        self._solids: Solids | None = None
        self._fields: list[MapField] = []

    def of(self, solids: Solids | None, step: float) -> list[MapField]:
        """Give them, for places that are so far apart at the least [m]."""
        if solids is None:
            return []
        if not same_solids(solids, self._solids):
            self._fields = [MapField(boxes.grid, step) for boxes in solids.boxes]
            self._solids = solids
        return self._fields


class MapField:
    """Distances from the occupied cells of a map, with a border of free cells around it.

    `grid`: whose. `step`: least distance between two places that are asked for [m].
    """

    def __init__(self, grid: OccupancyGrid, step: float) -> None:
        self._grid = grid
        size = grid.resolution * np.array(grid.occupied.shape) + 4.0 * BORDER
        least = math.sqrt(float(size.prod()) / FIELD_CELLS)
        fine = int(0.5 * step / grid.resolution + 1e-9)
        joined = max(1, fine, math.ceil(least / grid.resolution - 1e-9))
        self._side = joined * grid.resolution
        blocks = _blocks(grid.occupied, joined)
        self._border = math.ceil(2.0 * BORDER / self._side)
        away = ndimage.distance_transform_edt(~np.pad(blocks, self._border))
        self._distance: Array = self._side * (away - 0.5)
        self.landmarks = grid.to_map(self._side * _pieces(blocks))
        """(L, 2) a point in each piece of the map that hangs together [m]."""

    def distances(self, places: Array) -> Array:
        """Distance (n,) of places (n, 2) from the occupied cells [m]."""
        at = self._grid.to_grid(places).T[::-1] / self._side - 0.5 + self._border
        found: Array = ndimage.map_coordinates(self._distance, at, order=1, mode="nearest")
        return found


def _blocks(occupied: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Blocks of so many cells a side, occupied where a cell of theirs is."""
    if side == 1:
        return occupied
    height, width = occupied.shape
    rows = np.logical_or.reduceat(occupied, np.arange(0, height, side), axis=0)
    return np.logical_or.reduceat(rows, np.arange(0, width, side), axis=1)


def _pieces(blocks: NDArray[np.bool_]) -> Array:
    """Column and row (L, 2) of the middle of a block in each piece that hangs together."""
    labels, pieces = ndimage.label(blocks, np.ones((3, 3)))
    occupied = np.flatnonzero(labels)[::-1]
    first = np.empty(pieces + 1, dtype=np.intp)
    # of the blocks of a piece the one that comes last counts: the first of all
    first[labels.ravel()[occupied]] = occupied
    row, column = np.divmod(first[1:], labels.shape[1])
    return np.column_stack([column, row]) + 0.5


class Ways:
    """Shortest ways on a grid to a goal, from everywhere.

    `free`: nodes (H, W) that ways may use. `costs`: how many times its length a way from each of
    them counts (H, W). `step`: distance between neighbours along the axes [m]. `goal`: number of
    the goal's node.
    """

    def __init__(self, free: NDArray[np.bool_], costs: Array, step: float, goal: int) -> None:
        self.cost, self._towards = library.ways(free, costs, step, goal)
        """(H W,) of the way from each node [m]; infinite if there is none."""

    def line_from(self, node: int) -> list[int]:
        """Numbers of the nodes on the way from a node to the goal."""
        line = [node]
        while (following := int(self._towards[line[-1]])) >= 0:
            line.append(following)
        return line
