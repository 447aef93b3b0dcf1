"""Rays into a world of circles and straight edges; nothing here is the controller's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from kmpc_lite.sim import Scenario

Array = NDArray[np.floating[Any]]
PARALLEL = 1e-12
"""Rays along an edge do not hit it."""


class World:
    """Obstacles that rays can hit.

    Parameters
    ----------
    circles_at : callable
        Rows x, y, radius, ... [m] at a time [s].
    edges : ndarray
        Straight edges at rest, rows x1, y1, x2, y2 (S, 4) [m].

    Examples
    --------
    >>> world = World(lambda time: [[2.0, 0.0, 0.5]], np.array([[-1.0, -1.0, -1.0, 1.0]]))
    >>> start = np.zeros((3, 2))
    >>> world.cast(start, np.array([0.0, math.pi, math.pi / 2]), 0.0).round(3).tolist()
    [1.5, 1.0, inf]
    """

    def __init__(self, circles_at: Callable[[float], Any], edges: Array | None = None) -> None:
        self._circles_at = circles_at
        self._edges = np.zeros((0, 4)) if edges is None else np.asarray(edges, dtype=float)

    @classmethod
    def of(cls, scenario: Scenario) -> World:
        """Make the world of a scenario: its circles, polygons, walls and grid."""
        rounds = [(w.x1, w.y1, 0.5 * w.thickness) for w in scenario.walls]
        rounds += [(w.x2, w.y2, 0.5 * w.thickness) for w in scenario.walls]
        ends = np.array(rounds).reshape(-1, 3)

        def circles_at(time: float) -> Array:
            return np.concatenate([scenario.circles_at(time)[:, :3], ends])

        edges = [outline(np.array(polygon.vertices)) for polygon in scenario.polygons]
        edges += [outline(sides(w.x1, w.y1, w.x2, w.y2, w.thickness)) for w in scenario.walls]
        if scenario.grid is not None:
            for x_min, y_min, x_max, y_max in scenario.grid.rectangles:
                box = np.array([(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)])
                edges.append(outline(scenario.grid.to_map(box)))
        return cls(circles_at, np.concatenate([np.zeros((0, 4)), *edges]))

    def cast(self, places: Array, directions: Array, time: float) -> Array:
        """Distances (N,) [m] from places (N, 2) [m] along directions (N,) [rad]; inf for none."""
        along = np.stack([np.cos(directions), np.sin(directions)], axis=1)
        found = self._to_edges(places, along)
        circles = np.asarray(self._circles_at(time), dtype=float)
        if len(circles):
            found = np.minimum(found, _to_circles(places, along, circles))
        return found

    def _to_edges(self, places: Array, along: Array) -> Array:
        if not len(self._edges):
            return np.full(len(places), np.inf)
        begin, step = self._edges[:, :2], self._edges[:, 2:] - self._edges[:, :2]
        to = begin - places[:, None]
        cross = along[:, :1] * step[:, 1] - along[:, 1:] * step[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (to[..., 0] * step[:, 1] - to[..., 1] * step[:, 0]) / cross
            share = (to[..., 0] * along[:, 1:] - to[..., 1] * along[:, :1]) / cross
        hit = (np.abs(cross) > PARALLEL) & (distance >= 0.0) & (share >= 0.0) & (share <= 1.0)
        nearest: Array = np.where(hit, distance, np.inf).min(axis=1)
        return nearest


def _to_circles(places: Array, along: Array, circles: Array) -> Array:
    to = circles[:, :2] - places[:, None]
    ahead = to[..., 0] * along[:, :1] + to[..., 1] * along[:, 1:]
    beside = to[..., 0] * along[:, 1:] - to[..., 1] * along[:, :1]
    half = circles[:, 2] ** 2 - beside**2
    root = np.sqrt(np.maximum(half, 0.0))
    near = np.where(ahead - root >= 0.0, ahead - root, np.where(ahead + root >= 0.0, 0.0, np.inf))
    nearest: Array = np.where(half >= 0.0, near, np.inf).min(axis=1)
    return nearest


def outline(corners: Array) -> Array:
    """Edges (K, 4) between corners (K, 2), the last to the first."""
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def sides(x1: float, y1: float, x2: float, y2: float, thickness: float) -> Array:
    """Corners (4, 2) of a wall without its round ends [m]."""
    length = math.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return np.array([(x1, y1)] * 4)
    across = 0.5 * thickness / length * np.array([y1 - y2, x2 - x1])
    a, b = np.array([x1, y1]), np.array([x2, y2])
    return np.array([a + across, a - across, b - across, b + across])
