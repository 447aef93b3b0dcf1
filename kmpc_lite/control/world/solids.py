"""Polygons, walls and grids of a map as arrays, prepared once.

Polygons and walls are rounded convex outlines, the occupied cells of a grid are rectangles along
its axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.world.occupancy import AT, GRID_COLUMNS, Boxes, OccupancyGrid
from kmpc_lite.control.world.outlines import MANY, Outlines, corners_of, sharpen, with_turning
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

Body = tuple[Footprint, Array]  # a footprint, and its poses (n, 3)


def _cells(places: Array) -> list[Array]:
    """Numbers of places (n, 2) that lie in one square cell each, some times the root of n cells."""
    low = places.min(axis=0)
    count = math.ceil(1.75 * len(places) ** 0.25)
    side = max(float((places.max(axis=0) - low).max()) / count, AT)
    number = ((places - low) / side).astype(np.intp) @ (1, count + 1)
    order = number.argsort(kind="stable")
    return np.split(order, np.flatnonzero(np.diff(number[order])) + 1)


def _measure(outlines: Outlines, points: Array, body: Body | None) -> tuple[Array, Array]:
    """Distances (n, P) of points (n, 2) from outlines, and normals, as `Nearby.measure`."""
    distance, normals = outlines.distances(points)
    if body is not None:
        normals = _turned(normals, points, body)
        sharpen(outlines, *body, distance, normals)
    return distance, normals


def _turned(normals: Array, points: Array, body: Body) -> Array:
    """Slopes by the poses (n, C, 3) of the circles of a footprint that stand for points (n, 2)."""
    arms = points - body[1][:, :2].repeat(len(body[0].circles), axis=0)
    return with_turning(normals, arms[:, None])


def _look(
    outlines: Outlines, points: Array, body: Body | None, normals: bool = False, few: bool = False
) -> Array:
    """Distance (n, 1) of points (n, 2) from the nearest of outlines [m]; and the normal there."""
    if few or len(points) * outlines.edge_count <= MANY:
        distance, away = _measure(outlines, points, body)
        if not normals:
            return np.asarray(distance.min(axis=1, keepdims=True))
        rows, which = np.arange(len(points)), distance.argmin(axis=1)
        return np.column_stack([distance[rows, which], away[rows, which]])
    circles, poses = (1, points) if body is None else (len(body[0].circles), body[1])
    of_pose, found, cells = points.reshape(-1, circles, 2), list[Array](), _cells(poses[:, :2])
    outline = body[0].circle_radius if body else 0.0
    for some in cells:
        mine = of_pose[some].reshape(-1, 2)
        middle = 0.5 * (mine.min(axis=0) + mine.max(axis=0))
        away = outlines.distances(middle[None])[0][0]
        # what is nearest to one of these is hardly farther from their middle than the nearest there
        part = None if body is None else (body[0], poses[some])
        spread = float(np.hypot(*(mine - middle).T).max()) + outline
        near = outlines.take(away <= away.min() + 2.0 * spread)
        found.append(_look(near, mine, part, normals, True).reshape(len(some), circles, -1))
    out = np.empty((len(poses), *found[0].shape[1:]))
    out[np.concatenate(cells)] = np.concatenate(found)
    return out.reshape(len(points), -1)


class Nearby:
    """The solids that a robot can come to: what a step looks at."""

    def __init__(self, outlines: Outlines, boxes: Sequence[Boxes]) -> None:
        self._outlines, self._boxes = outlines, tuple(boxes)
        self._parts = outlines.walls_and_polygons()
        self.columns = len(outlines) + sum(min(GRID_COLUMNS, len(b.low)) for b in self._boxes)
        """How many distances each point gets."""

    def __len__(self) -> int:
        return self.columns

    def with_boxes(self, boxes: Sequence[Boxes]) -> Nearby:
        """Return these and more rectangles."""
        return Nearby(self._outlines, [*self._boxes, *boxes])

    def measure(self, points: Array, body: Body | None = None) -> tuple[Array, Array]:
        """Distances (n, C) and normals (n, C, 2) of the solids that matter at points (n, 2) [m].

        Of the circles of a footprint's poses, if these are given, no nearer than its outline, and
        slopes by the poses (n, C, 3).
        """
        distance, normals = np.empty((len(points), 0)), np.empty((len(points), 0, 3 if body else 2))
        if len(self._outlines):
            distance, normals = _measure(self._outlines, points, body)
        for boxes in self._boxes:
            _, gaps, away = boxes.choose(points)
            if body is not None:
                away = _turned(away, points, body)
            distance = np.concatenate([distance, gaps], axis=1)
            normals = np.concatenate([normals, away], axis=1)
        return distance, normals

    def least(self, points: Array, body: Body | None = None, maps: bool = True) -> Array:
        """Distance (n,) of points (n, 2) from the nearest of these solids [m], negative inside.

        Of a footprint's circles no nearer than its outline; with maps, or of all else alone.
        """
        least = np.full(len(points), np.inf)
        for part in self._parts if len(points) else ():
            least = np.minimum(least, _look(part, points, body)[:, 0])
        for boxes in self._boxes if maps else ():
            least = np.minimum(least, boxes.least(points))
        return least

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Distance (n,) of points (n, 2) from the nearest of these, and the normal (n, 2)."""
        found, rows = np.full((len(points), 3), np.inf), list[Array]()
        for part in self._parts if len(points) else ():
            rows.append(_look(part, points, None, True))
        for boxes in self._boxes:
            _, gaps, away = boxes.choose(points, 1)
            rows.append(np.column_stack([gaps, away[:, 0]]))
        for row in rows:
            np.copyto(found, row, where=row[:, :1] < found[:, :1])
        return found[:, 0], found[:, 1:]


class Solids:
    """Solids of a map, prepared once.

    `solids`: at rest.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.solids = tuple(solids)
        outlines, self.boxes = list[Polygon | Wall](), list[Boxes]()
        for solid in solids:
            if not isinstance(solid, OccupancyGrid):
                outlines.append(solid)
            elif len(sides := solid.rectangles):
                self.boxes.append(Boxes(sides[:, :2].copy(), sides[:, 2:].copy(), solid))
        self.outlines = Outlines.of(outlines)
        self._outline_points = list(map(corners_of, outlines))
        self.whole = Nearby(self.outlines, self.boxes)
        """All of them, for a look that is not pressed for time."""
        begins = self.outlines.begins
        self.extent = float(np.abs([begins, begins + self.outlines.steps]).max(initial=0.0))
        for boxes in self.boxes:
            ends = boxes.grid.to_map(np.concatenate([boxes.low, boxes.high]))
            self.extent = max(self.extent, float(np.abs(ends).max()))
        """Largest coordinate [m]."""

    @cached_property
    def landmarks(self) -> Array:
        """Points (P, 2) in each polygon and wall [m]."""
        return np.array([c.mean(axis=0) for c in self._outline_points]).reshape(-1, 2)

    @cached_property
    def outermost(self) -> Array:
        """Points (K, 2) among which the outermost corners of all solids are [m]."""
        return np.concatenate(
            [np.empty((0, 2)), *self._outline_points, *(b.outermost for b in self.boxes)]
        )

    def within(self, point: Array, distance: float) -> Nearby:
        """Solids within a distance [m] of a point (2,) that the robot can come to."""
        here, outlines = point[None], self.outlines
        close = np.zeros(0, dtype=bool)
        if len(outlines):
            close = outlines.distances(here)[0][0] <= distance
        chosen = [(b, b.distances(here)[0] <= distance) for b in self.boxes]
        return Nearby(outlines.take(close), [b.take(near) for b, near in chosen if near.any()])


def same_solids(first: Solids | None, second: Solids | None) -> bool:
    """Whether two maps are one."""
    if first is second:
        return True
    return first is not None and second is not None and first.solids == second.solids
