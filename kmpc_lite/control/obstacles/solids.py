"""Polygons, walls and grids as arrays: how far points are from them, and in which direction.

Polygons and walls are rounded convex outlines, the occupied cells of a grid are rectangles along
its axes. The nearest point of each stands for it, with a normal that makes a half-plane in which
the whole convex shape lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from kmpc_lite.control.obstacles.occupancy import OccupancyGrid
from kmpc_lite.control.obstacles.scene import Solid
from kmpc_lite.control.obstacles.shapes import Polygon, Wall
from kmpc_lite.types import Array

GRID_COLUMNS = 4
"""Half-planes that a grid has at each stage: the nearest rectangle, then the nearest that does not
lie behind those taken."""
BEHIND = 1e-3
"""How far a rectangle's nearest point may stand out of a half-plane and count as behind it [m]."""
AT = 1e-9
"""Distance at which a direction cannot be told [m]."""


def corners_of(solid: Polygon | Wall) -> Array:
    """Corners of a polygon, or ends of a wall, (K, 2) [m]."""
    return np.array(
        solid.vertices
        if isinstance(solid, Polygon)
        else [(solid.x1, solid.y1), (solid.x2, solid.y2)]
    )


class Outlines:
    """Rounded convex outlines (P,) with at most E edges; shorter ones repeat their last edge.

    Parameters
    ----------
    begins, steps : ndarray
        Where edges begin, counter-clockwise, and how they go on, (P, E, 2) [m].
    rounding : ndarray
        Distance from the outline that belongs to the shape, (P,) [m].
    is_line : ndarray
        Which have one edge and no inside, (P,).
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
        corners = [corners_of(s) for s in solids]
        counts = [
            1 if isinstance(s, Wall) else len(c) for s, c in zip(solids, corners, strict=True)
        ]
        edges = [np.minimum(np.arange(max(counts)), count - 1) for count in counts]
        shape = len(solids), max(counts, default=1), 2
        begins = np.array([c[e] for c, e in zip(corners, edges, strict=True)]).reshape(shape)
        ends = np.array([c[(e + 1) % len(c)] for c, e in zip(corners, edges, strict=True)]).reshape(
            shape
        )
        rounding = np.array([0.5 * s.thickness if isinstance(s, Wall) else 0.0 for s in solids])
        return cls(
            begins,
            ends - begins,
            rounding,
            np.array([isinstance(s, Wall) for s in solids], dtype=bool),
        )

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
        walls, polygons = self.take(self.is_line), self.take(~self.is_line)
        walls = Outlines(walls.begins[:, :1], walls.steps[:, :1], walls.rounding, walls.is_line)
        return [part for part in (walls, polygons) if len(part)]

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


class Boxes:
    """Rectangles along the axes of a grid.

    Parameters
    ----------
    low, high : ndarray
        Corners (B, 2), (B, 2) [m], in the grid's frame.
    grid : OccupancyGrid
        Whose.
    """

    def __init__(self, low: Array, high: Array, grid: OccupancyGrid) -> None:
        self.low, self.high, self.grid = low, high, grid
        self._sides = [np.ascontiguousarray(side) for side in (*low.T, *high.T)]

    @property
    def outermost(self) -> Array:
        """Corners (4 B, 2) of the rectangles in the map [m]."""
        (x_min, y_min), (x_max, y_max) = self.low.T, self.high.T
        x = np.concatenate([x_min, x_max, x_max, x_min])
        y = np.concatenate([y_min, y_min, y_max, y_max])
        return self.grid.to_map(np.stack([x, y], axis=1))

    def take(self, chosen: Array) -> Boxes:
        """Some of the rectangles."""
        return Boxes(self.low[chosen], self.high[chosen], self.grid)

    def _away(self, points: Array, chosen: Array | None) -> tuple[Array, Array, Array]:
        """Distances (n, B) [m], negative inside, and x and y (n, B) of the normals times them.

        The normals are in the grid's frame.
        """
        here = self.grid.to_grid(points)
        x_min, y_min, x_max, y_max = (
            self._sides if chosen is None else (side.take(chosen) for side in self._sides)
        )
        x = np.maximum(here[:, :1], x_min)
        y = np.maximum(here[:, 1:], y_min)
        np.minimum(x, x_max, out=x)
        np.minimum(y, y_max, out=y)
        np.subtract(here[:, :1], x, out=x)
        np.subtract(here[:, 1:], y, out=y)
        distance = x * x
        distance += y * y
        np.sqrt(distance, out=distance)
        if distance.min(initial=1.0) <= AT:
            sides = np.stack(
                [
                    here[:, :1] - x_min,
                    here[:, 1:] - y_min,
                    x_max - here[:, :1],
                    y_max - here[:, 1:],
                ],
                axis=-1,
            )
            inside, side = distance <= AT, sides.argmin(axis=-1)
            # a side that is touched still has a direction
            distance = np.where(inside, np.minimum(-sides.min(axis=-1), -AT), distance)
            x = np.where(inside, distance * np.array([-1.0, 0.0, 1.0, 0.0])[side], x)
            y = np.where(inside, distance * np.array([0.0, -1.0, 0.0, 1.0])[side], y)
        return distance, x, y

    def distances(self, points: Array, chosen: Array | None = None) -> Array:
        """Distances (n, B) of points (n, 2) [m], negative inside.

        With `chosen` (n, K) only the distances (n, K) of these rectangles are computed.
        """
        return self._away(points, chosen)[0]

    def choose(self, points: Array) -> tuple[Array, Array, Array]:
        """Choose the rectangles that matter at points (n, 2) [m].

        Their numbers (n, K), distances (n, K) [m] and normals (n, K, 2) in the map are returned.
        """
        distance, x, y = self._away(points, None)
        count, rows = distance.shape[1], np.arange(len(points))
        columns = min(GRID_COLUMNS, count)
        if columns == count:
            chosen = np.broadcast_to(np.arange(columns), distance.shape)
        else:
            chosen = np.empty((len(points), columns), dtype=np.intp)
            left = distance.copy()
            for i in range(columns):
                nearest = left.argmin(axis=1)
                chosen[:, i] = nearest
                if i + 1 < columns:
                    # what lies behind the nearest one's half-plane, itself included, is done with
                    nearest += count * rows
                    near = distance.take(nearest)
                    along = x * (x.take(nearest) / near)[:, None]
                    along += y * (y.take(nearest) / near)[:, None]
                    np.putmask(left, along >= (near - BEHIND)[:, None], np.inf)
            place = chosen + (count * rows)[:, None]
            distance, x, y = distance.take(place), x.take(place), y.take(place)
        normals = np.empty((*distance.shape, 2))
        normals[..., 0], normals[..., 1] = x / distance, y / distance
        return chosen, distance, self.grid.turn(normals)


class Nearby:
    """The solids that a robot can come to: what a step looks at."""

    def __init__(self, outlines: Outlines, boxes: Sequence[Boxes]) -> None:
        self._outlines, self._boxes = outlines, tuple(boxes)
        self._count = len(outlines)
        self._chosen: list[Array] = []
        self.columns = self._count + sum(min(GRID_COLUMNS, len(b.low)) for b in self._boxes)
        """How many distances each point gets."""

    def __len__(self) -> int:
        return self.columns

    def measure(self, points: Array) -> tuple[Array, Array]:
        """Distances (n, C) and normals (n, C, 2) of the solids that matter at points (n, 2) [m].

        `again` computes the distances of the same choice.
        """
        distance, normals = (
            self._outlines.distances(points)
            if self._count
            else (np.empty((len(points), 0)), np.empty((len(points), 0, 2)))
        )
        self._chosen = []
        for boxes in self._boxes:
            chosen, gaps, away = boxes.choose(points)
            self._chosen.append(chosen)
            distance, normals = (
                np.concatenate([distance, gaps], axis=1),
                np.concatenate([normals, away], axis=1),
            )
        return distance, normals

    def again(self, points: Array) -> Array:
        """Distances (n, C) [m] of the solids that the last `measure` chose.

        There must be as many points (n, 2) [m] as there were then.
        """
        distance = (
            self._outlines.distances(points)[0] if self._count else np.empty((len(points), 0))
        )
        for boxes, chosen in zip(self._boxes, self._chosen, strict=True):
            distance = np.concatenate([distance, boxes.distances(points, chosen)], axis=1)
        return distance

    def least(self, points: Array) -> Array:
        """Distance (n,) of points (n, 2) from the nearest of these solids [m], negative inside."""
        least = np.full(len(points), np.inf)
        if self._count:
            least = self._outlines.distances(points)[0].min(axis=1)
        for boxes in self._boxes:
            least = np.minimum(least, boxes.distances(points).min(axis=1))
        return least


class Corners:
    """Corners of all solids, and the edges between them: what ways go around.

    Parameters
    ----------
    outlines : Outlines
        Of polygons and walls, numbered as below.
    corners : sequence of ndarray
        Corners (C, 2) of each polygon, wall and rectangle [m], in that order.
    boxes : sequence of Boxes
        The rectangles.
    """

    def __init__(
        self, outlines: Outlines, corners: Sequence[Array], boxes: Sequence[Boxes]
    ) -> None:
        self._outlines, self._boxes = outlines, boxes
        counts = np.array([len(c) for c in corners], dtype=np.intp)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        number = np.arange(int(counts.sum()))
        self.points = np.concatenate([np.empty((0, 2)), *corners])
        """(V, 2) [m]."""
        self.owner = np.repeat(np.arange(len(corners)), counts)
        """(V,) number of each corner's solid."""
        self.rounding = np.concatenate([outlines.rounding, np.zeros(len(corners) - len(outlines))])[
            self.owner
        ]
        """(V,) distance from a corner that belongs to the solid [m]."""
        following = first + (number - first + 1) % counts[self.owner]
        # a line has one edge, not one there and one back
        used = (counts[self.owner] > 2) | (number < following)
        self.edges = np.stack([number, following], axis=1)[used]
        """(S, 2) numbers of corners."""
        self.middles = np.array([c.mean(axis=0) for c in corners]).reshape(-1, 2)
        """(P, 2) a point within each solid [m]."""

    def to_centre(self, point: Array) -> Array:
        """Radius (V,) to which each corner can grow until its solid reaches a point (2,) [m].

        The edges of the solid grow with its corners.
        """
        here = point[None]
        gaps = [self._outlines.distances(here)[0][0]] if len(self._outlines) else []
        distance = np.concatenate(
            [np.empty(0), *gaps, *(b.distances(here)[0] for b in self._boxes)]
        )
        grown: Array = distance[self.owner] + self.rounding
        return grown


class Solids:
    """Solids of a map, prepared once.

    Parameters
    ----------
    solids : sequence of Polygon, Wall or OccupancyGrid
        At rest.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.solids = tuple(solids)
        self.outlines = Outlines.of([s for s in solids if not isinstance(s, OccupancyGrid)])
        rectangles = [(s, s.rectangles) for s in solids if isinstance(s, OccupancyGrid)]
        self.boxes = [
            Boxes(r[:, :2].copy(), r[:, 2:].copy(), grid) for grid, r in rectangles if len(r)
        ]
        self.whole = Nearby(self.outlines, self.boxes)
        """All of them, for a look that is not pressed for time."""
        edges = self.outlines.begins, self.outlines.begins + self.outlines.steps
        ends = [
            *(e.reshape(-1, 2) for e in edges),
            *(b.grid.to_map(np.concatenate([b.low, b.high])) for b in self.boxes),
        ]
        self.extent = float(max((np.abs(e).max(initial=0.0) for e in ends), default=0.0))
        """Largest coordinate [m]."""

    @property
    def rectangle_count(self) -> int:
        """How many rectangles the occupied cells of all grids make."""
        return sum(len(boxes.low) for boxes in self.boxes)

    @cached_property
    def outline_corners(self) -> Corners:
        """Corners of polygons and walls alone."""
        return Corners(self.outlines, self._outline_points, [])

    @cached_property
    def outermost(self) -> Array:
        """Points (K, 2) among which the outermost corners of all solids are [m]."""
        return np.concatenate(
            [np.empty((0, 2)), *self._outline_points, *(b.outermost for b in self.boxes)]
        )

    @property
    def _outline_points(self) -> list[Array]:
        return [corners_of(s) for s in self.solids if not isinstance(s, OccupancyGrid)]

    @cached_property
    def all_corners(self) -> Corners:
        """Corners of all solids."""
        corners = self._outline_points
        for boxes in self.boxes:
            (x_min, y_min), (x_max, y_max) = boxes.low.T, boxes.high.T
            around = np.stack(
                [
                    np.stack([x_min, x_max, x_max, x_min], 1),
                    np.stack([y_min, y_min, y_max, y_max], 1),
                ],
                axis=-1,
            )
            corners += list(boxes.grid.to_map(around))
        return Corners(self.outlines, corners, self.boxes)

    def within(self, point: Array, distance: float) -> Nearby:
        """Solids within a distance [m] of a point (2,) that the robot can come to."""
        here, outlines = point[None], self.outlines
        close = np.zeros(0, dtype=bool)
        if len(outlines):
            close = outlines.distances(here)[0][0] <= distance
        chosen = [(b, b.distances(here)[0] <= distance) for b in self.boxes]
        return Nearby(outlines.take(close), [b.take(near) for b, near in chosen if near.any()])
