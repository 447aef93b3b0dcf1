"""Polygons, walls and grids of a map as arrays, prepared once.

Polygons and walls are rounded convex outlines, the occupied cells of a grid are rectangles along
its axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.world.boxes import GRID_COLUMNS, Boxes
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outline_gaps import sharpen, with_turning
from kmpc_lite.control.world.outlines import Outlines, corners_of
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

Body = tuple[Footprint, Array]
"""A footprint, and its poses (n, 3)."""


class Nearby:
    """The solids that a robot can come to: what a step looks at."""

    def __init__(self, outlines: Outlines, boxes: Sequence[Boxes]) -> None:
        self._outlines, self._boxes = outlines, tuple(boxes)
        self._count = len(outlines)
        self.columns = self._count + sum(min(GRID_COLUMNS, len(b.low)) for b in self._boxes)
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
        distance, normals = np.empty((len(points), 0)), np.empty((len(points), 0, 2))
        if self._count:
            distance, normals = self._outlines.distances(points)
        if body is not None:
            footprint, poses = body
            arms = (points - poses[:, :2].repeat(len(footprint.circles), axis=0))[:, None]
            normals = with_turning(normals, arms)
            sharpen(self._outlines, footprint, poses, distance, normals)
        for boxes in self._boxes:
            _, gaps, away = boxes.choose(points)
            if body is not None:
                away = with_turning(away, arms)
            distance = np.concatenate([distance, gaps], axis=1)
            normals = np.concatenate([normals, away], axis=1)
        return distance, normals

    def least(self, points: Array, body: Body | None = None) -> Array:
        """Distance (n,) of points (n, 2) from the nearest of these solids [m], negative inside.

        Of the circles of a footprint's poses, if these are given, no nearer than its outline.
        """
        distance, _ = Nearby(self._outlines, ()).measure(points, body)
        least: Array = distance.min(axis=1, initial=np.inf)
        for boxes in self._boxes:
            least = np.minimum(least, boxes.least(points))
        return least


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
