"""Polygons and walls as rounded convex outlines: how far points are from them, and which way.

The nearest point of each stands for it, with a normal that makes a half-plane in which the whole
shape lies. A robot's own outline is measured corner to edge, and edge to corner: the circles that
cover it stick out of it, at its ends by a fifth of its width, too much where a car parks between
two others.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.world.occupancy import AT
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

MANY = 2**15
"""Points times edges beyond which the outlines that may be nearest are looked up by cells."""
NEAR = 0.25
"""How near the circles must be for the outline itself to be looked at [radii of a circle]."""
KEPT = 0.1
"""What the outline keeps all the same [radii of a circle]: no robot drives as its model says."""


def corners_of(solid: Polygon | Wall) -> Array:
    """Corners of a polygon, or ends of a wall, (K, 2) [m]."""
    return np.array(
        solid.vertices
        if isinstance(solid, Polygon)
        else [(solid.x1, solid.y1), (solid.x2, solid.y2)]
    )


class Outlines:
    """Rounded convex outlines (P,) with at most E edges; shorter ones repeat their last edge.

    `begins`, `steps`: where edges begin, counter-clockwise, and how they go on, (P, E, 2) [m].
    `rounding`: distance from the outline that belongs to the shape, (P,) [m]. `is_line`: which have
    one edge and no inside, (P,).
    """

    def __init__(self, begins: Array, steps: Array, rounding: Array, is_line: Array) -> None:
        self.begins, self.steps, self.rounding, self.is_line = begins, steps, rounding, is_line
        self._edges = begins.shape[1]
        # all edges in one row, since NumPy's time is one of calls
        begin, step = begins.reshape(-1, 2), steps.reshape(-1, 2)
        squares = np.einsum("fi,fi->f", step, step)
        scaled = step / np.maximum(squares, AT**2)[:, None]
        self._outward = (
            np.column_stack([step[:, 1], -step[:, 0]]) / np.maximum(np.sqrt(squares), AT)[:, None]
        )
        across, across_begin = self._outward.copy(), np.einsum("fi,fi->f", self._outward, begin)
        # beyond a line's edge is everything
        line = np.repeat(is_line, self._edges)
        across[line], across_begin[line] = 0.0, -1.0
        self._along, self._along_begin = (
            np.ascontiguousarray(scaled.T),
            np.einsum("fi,fi->f", scaled, begin),
        )
        self._across, self._across_begin = np.ascontiguousarray(across.T), across_begin
        self._begin_x, self._begin_y = np.ascontiguousarray(begin.T)
        self._step_x, self._step_y = np.ascontiguousarray(step.T)
        self._first = self._edges * np.arange(len(begins))
        self._has_inside = not bool(is_line.all())

    def __len__(self) -> int:
        return len(self.rounding)

    @classmethod
    def of(cls, solids: Sequence[Polygon | Wall]) -> Outlines:
        """Outlines of polygons and walls."""
        corners = list(map(corners_of, solids))
        is_line = np.array([isinstance(solid, Wall) for solid in solids], dtype=bool)
        counts = np.where(is_line, 1, np.fromiter(map(len, corners), int, len(corners)))
        begins = np.empty((len(corners), counts.max(initial=1), 2))
        ends, rounding = np.empty_like(begins), np.zeros(len(corners))
        for k, (solid, points) in enumerate(zip(solids, corners, strict=True)):
            edges = np.minimum(np.arange(begins.shape[1]), counts[k] - 1)
            begins[k], ends[k] = points[edges], points[(edges + 1) % len(points)]
            rounding[k] = 0.5 * solid.thickness if isinstance(solid, Wall) else 0.0
        return cls(begins, ends - begins, rounding, is_line)

    def take(self, chosen: Array) -> Outlines:
        """Some of the outlines."""
        return Outlines(
            self.begins[chosen], self.steps[chosen], self.rounding[chosen], self.is_line[chosen]
        )

    @property
    def edge_count(self) -> int:
        """Edges that are looked at for each point."""
        return len(self._begin_x)

    def walls_and_polygons(self) -> list[Outlines]:
        """Give the same apart, where there are both: walls have one edge, and need not more."""
        if self.is_line.all() or not self.is_line.any():
            return [self] if len(self) else []
        walls, polygons = self.take(self.is_line), self.take(~self.is_line)
        walls = Outlines(walls.begins[:, :1], walls.steps[:, :1], walls.rounding, walls.is_line)
        return [walls, polygons]

    def distances(self, points: Array) -> tuple[Array, Array]:
        """Distances (n, P) of points (n, 2) [m], negative inside, and normals (n, P, 2)."""
        share = points @ self._along
        share -= self._along_begin
        np.maximum(share, 0.0, out=share)
        np.minimum(share, 1.0, out=share)
        x, y = share * self._step_x, share * self._step_y
        x += self._begin_x
        y += self._begin_y
        np.subtract(points[:, :1], x, out=x)
        np.subtract(points[:, 1:], y, out=y)
        squares = x * x
        squares += y * y
        nearest = squares.reshape(len(points), -1, self._edges).argmin(axis=2)
        nearest += self._first
        edge = nearest + len(self._begin_x) * np.arange(len(points))[:, None]
        distance = np.sqrt(squares.take(edge))
        normals = np.empty((*distance.shape, 2))
        normals[..., 0], normals[..., 1] = x.take(edge), y.take(edge)
        depth = None
        if self._has_inside:
            beyond = points @ self._across
            beyond -= self._across_begin
            depth = beyond.reshape(len(points), -1, self._edges).max(axis=2)
        if (depth is not None and depth.min() < 0.0) or distance.min(initial=1.0) <= AT:
            inside = np.zeros(distance.shape, dtype=bool) if depth is None else depth < 0.0
            normals /= np.maximum(distance, AT)[..., None]
            normals = np.where(
                (inside | (distance <= AT))[..., None], self._outward[nearest], normals
            )
            # a wall without a length has no sides: any direction leads away
            normals[..., 0] += ~normals.any(axis=-1)
            distance[inside] *= -1.0
        else:
            normals /= distance[..., None]
        distance -= self.rounding
        return distance, normals


def sharpen(
    outlines: Outlines, footprint: Footprint, poses: Array, distances: Array, slopes: Array
) -> None:
    """Let no circle be nearer to a solid than the outline that it covers; in place.

    The rows of its circles are those of the points in which it comes nearest then: a corner of one
    and an edge of the other, each with what turning does to it.

    `outlines`: p solids. `footprint`: covered by C circles. `poses`: (n, 3) of the robot.
    `distances`, `slopes`: of the circles' middles from the solids, (n C, P) [m], and by a pose's
    coordinates, (n C, P, 3).
    """
    if not (len(outlines) and footprint.is_covered_closely):
        return
    count, radius = len(footprint.circles), footprint.circle_radius
    shape = len(poses), count, len(outlines)
    found, away = distances.reshape(shape), slopes.reshape(*shape, 3)
    least = found.min(axis=1)
    nearest = least.min(axis=1)
    # what lies in a circle in the robot touches it, and is as deep as the circles say
    is_near = (nearest < radius * (1.0 + NEAR)) & (nearest > footprint.core_radius)
    if not len(near := np.flatnonzero(is_near)):
        return
    whole, directions = outline_gaps(outlines, footprint, poses[near], count)
    # what lies in the robot lies in one of the circles in it
    whole = np.minimum(whole, (least[near] - footprint.core_radius)[:, None])
    whole += radius * (1.0 - KEPT)
    farther = (whole[:, 0] > least[near])[:, None]
    found[near] = np.where(farther, whole, found[near])
    away[near] = np.where(farther[..., None], directions, away[near])


def outline_gaps(
    outlines: Outlines, footprint: Footprint, poses: Array, count: int
) -> tuple[Array, Array]:
    """Distances (n, count, P) of a robot from solids [m], and slopes by its pose (n, count, P, 3).

    Of the points in which they are nearest, corners of one from edges of the other, the first is
    the robot's distance. Below zero where a corner of one lies in the other. Outlines that cross
    without that are not noticed: the circles inside the robot tell them.

    `outlines`: p of them. `footprint`: the robot's outline, of K corners. `poses`: (n, 3) of the
    robot. `count`: how many points, at most K + 1.
    """
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    arms = footprint.outline @ turns
    mine, away = outlines.distances((arms + poses[:, None, :2]).reshape(-1, 2))
    shape = len(poses), len(footprint.outline), len(outlines)
    slopes = with_turning(away.reshape(*shape, 2), arms[:, :, None])
    # corners of the solids, as the robot sees them; an edge that is there again tells nothing new
    begins = outlines.begins
    others = np.concatenate([begins, begins[:, :1] + outlines.steps[:, :1]], axis=1)
    again = np.zeros(others.shape[:2], dtype=bool)
    again[:, 1:-1] = (begins[:, 1:] == begins[:, :-1]).all(axis=-1)
    again[:, -1] = ~outlines.is_line
    reach = others - poses[:, None, None, :2]
    seen = reach @ turns.transpose(0, 2, 1)[:, None]
    theirs, towards = _body(footprint).distances(seen.reshape(-1, 2))
    away = -(towards.reshape(seen.shape) @ turns[:, None])
    theirs = np.where(again, np.inf, theirs.reshape(seen.shape[:-1]) - outlines.rounding[:, None])
    found = np.concatenate([mine.reshape(shape), theirs.swapaxes(1, 2)], axis=1)
    slopes = np.concatenate([slopes, with_turning(away, reach).swapaxes(1, 2)], axis=1)
    chosen = np.argsort(found, axis=1)[:, :count]
    nearest = np.take_along_axis(found, chosen, 1)
    return nearest, np.take_along_axis(slopes, chosen[..., None], 1)


def with_turning(away: Array, arms: Array) -> Array:
    """Slopes (..., 3) by a robot's pose of distances of points on it.

    `away`: directions in which the points leave what they are near, (..., 2). `arms`: from the
    robot to the points, (..., 2) [m].
    """
    turn = away[..., 1] * arms[..., 0] - away[..., 0] * arms[..., 1]
    return np.concatenate([away, turn[..., None]], axis=-1)


@lru_cache(maxsize=8)
def _body(footprint: Footprint) -> Outlines:
    """The robot's outline in its own frame, as distances from it are asked for."""
    corners = footprint.outline[None]
    steps = np.roll(corners, -1, axis=1) - corners
    return Outlines(corners, steps, np.zeros(1), np.zeros(1, dtype=bool))
