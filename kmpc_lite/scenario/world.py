"""What rays meet among a scenario's obstacles, worked out exactly, and how far a robot is off them.

It shares no code with what the controller makes of a scan.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.kernels.records import distances, things_of
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array


class World:
    """What rays meet: circles that may move, and edges at rest.

    `circles`: (M, 5) rows x, y, radius, vx, vy [m, m/s]. `edges`: (S, 4) rows x1, y1, x2, y2 [m].

    Examples
    --------
    >>> world = World([(2.0, 0.0, 0.5, 0.0, 0.0)], [(-1.0, -1.0, -1.0, 1.0)])
    >>> world.ranges(np.zeros(2), np.array([0.0, np.pi, np.pi / 2])).round(3).tolist()
    [1.5, 1.0, inf]
    """

    def __init__(self, circles: ArrayLike = (), edges: ArrayLike = ()) -> None:
        self.circles = np.asarray(circles, dtype=float).reshape(-1, 5)
        self.edges = np.asarray(edges, dtype=float).reshape(-1, 4)

    def ranges(self, origin: Array, directions: Array, time: float = 0.0) -> Array:
        """How far rays go until they meet something, (B,) [m]; infinite if they meet nothing.

        `origin`: where they begin: (2,) all of them, or (B, 2) each [m]. `directions`: (B,) [rad].
        `time`: for which circles have moved [s].
        """
        begin_x, begin_y = origin[..., 0, None], origin[..., 1, None]
        cos, sin = np.cos(directions)[:, None], np.sin(directions)[:, None]
        nearest = np.full(len(directions), np.inf)
        if len(self.circles):
            x = self.circles[:, 0] + time * self.circles[:, 3] - begin_x
            y = self.circles[:, 1] + time * self.circles[:, 4] - begin_y
            along, aside = cos * x + sin * y, sin * x - cos * y
            half = self.circles[:, 2] ** 2 - aside**2
            enters = along - np.sqrt(np.maximum(half, 0.0))
            met = (half >= 0.0) & (enters >= 0.0)
            nearest = np.where(met, enters, np.inf).min(axis=1)
        if len(self.edges):
            x1, x2 = self.edges[:, 0] - begin_x, self.edges[:, 2] - begin_x
            y1, y2 = self.edges[:, 1] - begin_y, self.edges[:, 3] - begin_y
            step_x, step_y = x2 - x1, y2 - y1
            across = cos * step_y - sin * step_x
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (x1 * step_y - y1 * step_x) / across
                share = (sin * x1 - cos * y1) / across
                # no comparison is true of a ray along an edge: it meets the next one
                met = (distance >= 0.0) & (share >= 0.0) & (share <= 1.0)
            nearest = np.minimum(nearest, np.where(met, distance, np.inf).min(axis=1))
        return nearest

    def clearance(self, points: Array, times: Array) -> Array:
        """Distance (n,) from points (n, 2) at times (n,) to the nearest edge or circle [m]."""
        nearest = np.full(len(points), np.inf)
        if len(self.circles):
            x = points[:, :1] - self.circles[:, 0] - times[:, None] * self.circles[:, 3]
            y = points[:, 1:] - self.circles[:, 1] - times[:, None] * self.circles[:, 4]
            nearest = (np.hypot(x, y) - self.circles[:, 2]).min(axis=1)
        if len(self.edges):
            begin, step = self.edges[:, :2], self.edges[:, 2:] - self.edges[:, :2]
            away = points[:, None] - begin
            squares = np.maximum((step * step).sum(axis=1), 1e-300)
            share = np.clip((away * step).sum(axis=2) / squares, 0.0, 1.0)
            away -= share[..., None] * step
            nearest = np.minimum(nearest, np.hypot(away[..., 0], away[..., 1]).min(axis=1))
        return nearest


def world_of(scenario: Scenario) -> World:
    """Circles and edges of a scenario's obstacles."""
    circles = [tuple(circle) for circle in scenario.circles]
    edges = [np.empty((0, 4))]
    for polygon in scenario.polygons:
        corners = np.array(polygon.vertices)
        edges.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    for wall in scenario.walls:
        begin, end = np.array([wall.x1, wall.y1]), np.array([wall.x2, wall.y2])
        half = 0.5 * wall.thickness
        along = (end - begin) / max(wall.length, 1e-9)
        aside = half * np.array([-along[1], along[0]])
        edges.append(np.array([[*(begin + s * aside), *(end + s * aside)] for s in (1.0, -1.0)]))
        circles += [(*point, half, 0.0, 0.0) for point in (begin, end)]
    if scenario.grid is not None:
        for x1, y1, x2, y2 in scenario.grid.rectangles:
            corners = scenario.grid.to_map(np.array([(x1, y1), (x2, y1), (x2, y2), (x1, y2)]))
            edges.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    return World(np.array(circles, dtype=float).reshape(-1, 5), np.concatenate(edges))


def obstacle_gaps(scenario: Scenario, poses: Array, times: Array) -> Array:
    """Distances (n,) from a robot at poses (n, 3) [m, m, rad] to its nearest obstacle.

    Obstacles stand where they are at times (n,) [s]; distances [m] are those between edges.
    """
    if scenario.footprint is None:
        return point_gaps(scenario, poses[:, :2], times) - scenario.radius
    # here, since most robots are round
    from kmpc_lite.scenario.touch import footprint_gaps

    circles = np.array([scenario.circles_at(time) for time in times.tolist()])
    solids = () if scenario.solids is None else scenario.solids.solids
    return footprint_gaps(scenario.footprint, poses, circles, solids)


def point_gaps(scenario: Scenario, points: Array, times: Array) -> Array:
    """Distances (n,) from points (n, 2) to the nearest obstacle at times (n,) [m], [s]."""
    gaps = np.full(len(points), np.inf)
    if scenario.circles:
        gaps = distances(things_of(scenario.circles_at(0.0)), points, times).min(axis=1)
    if scenario.solids is not None:
        gaps = np.minimum(gaps, scenario.solids.whole.least(points))
    return gaps
