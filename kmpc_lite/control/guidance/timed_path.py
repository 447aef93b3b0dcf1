"""A way to the goal as poses over time: how fast the bounds allow it to be driven, and where on it the robot is."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.guidance.tangent_graph import GeometricPath, wrap
from kmpc_lite.types import Array

RESOLUTION = 0.05
"""Time between the poses that the robot's place is looked up on [s]."""
MOST_POSES = 20_000
"""Poses of that kind at the most; at 0.05 s enough for a quarter of an hour."""
TURN_LENGTH = 0.3
"""A turn of one radian counts as that many metres when the robot's place is looked up."""
BACKWARD, FORWARD = 0.5, 1.5
"""How far the robot's place may move in one look-up [s]."""


class TimedPath:
    """Poses along a way, at the times at which they can be reached.

    Parameters
    ----------
    way : Way
        Points and directions.
    start, goal : ndarray
        Poses (3,).
    speed : ndarray
        Speed [m/s] and rate of turn [rad/s] to drive at, (2,).
    free_turn : float
        Part of the first turn that is left to the controller, to be made while driving [rad].
    """

    def __init__(
        self, way: GeometricPath, start: Array, goal: Array, speed: Array, free_turn: float = 0.0
    ) -> None:
        self.way, self.goal = way, goal
        heading = way.headings + (np.pi if way.reverse else 0.0)
        first = float(wrap(heading[0] - start[2]))
        last = float(wrap(goal[2] - heading[-1]))
        rest = np.sign(first) * max(abs(first) - free_turn, 0.0)
        heading = heading + (start[2] + first - heading[0])
        self.poses = np.empty((len(heading) + 2, 3))
        self.poses[1:-1, :2], self.poses[1:-1, 2] = way.points, heading
        self.poses[0] = (*way.points[0], heading[0] - rest)
        self.poses[-1] = (goal[0], goal[1], heading[-1] + last)
        steps = np.diff(self.poses, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        needed = np.maximum(lengths / speed[0], np.abs(steps[:, 2]) / speed[1])
        self.times = np.concatenate([[0.0], np.cumsum(np.maximum(needed, 1e-9))])
        self._columns = np.ascontiguousarray(self.poses.T)
        self.duration = float(self.times[-1])
        self.drive_end = float(self.times[-2])
        """When the goal's position is reached, and the last turn begins [s]."""
        # a robot that hardly moves would need more poses than there is memory
        self._resolution = max(RESOLUTION, self.duration / MOST_POSES)
        self._grid_times = np.append(np.arange(0.0, self.duration, self._resolution), self.duration)
        self._grid = self.at(self._grid_times) * (1.0, 1.0, TURN_LENGTH)
        self.place = 0.0

    @property
    def points(self) -> Array:
        """The way's points (K, 2)."""
        return self.way.points

    def at(self, times: Array) -> Array:
        """Poses (n, 3) at times (n,) [s]; the ends are held."""
        poses = np.empty((len(times), 3))
        for i, column in enumerate(self._columns):
            poses[:, i] = np.interp(times, self.times, column)
        return poses

    def locate(self, pose: Array, least: float = 0.0) -> tuple[float, float]:
        """Find the time [s] of the path's pose that is nearest, not before `least` [s], and its distance [m]; near the last one found."""
        last = max(self.place, least)
        begin = int(max(self.place - BACKWARD, least) / self._resolution)
        end = int((last + FORWARD) / self._resolution) + 2
        x, y, heading = pose.tolist()
        # next to the heading at the last place: the robot has not turned by half a circle since
        heading -= (
            2
            * math.pi
            * round(
                (heading - self._grid.item(int(last / self._resolution), 2) / TURN_LENGTH)
                / (2 * math.pi)
            )
        )
        error = self._grid[begin:end] - (x, y, TURN_LENGTH * heading)
        nearest = int(np.einsum("ni,ni->n", error, error).argmin())
        self.place = float(self._grid_times[begin + nearest])
        return self.place, math.hypot(error.item(nearest, 0), error.item(nearest, 1))

    def points_left(self, pose: Array) -> Array:
        """Points (K, 2) from a robot's pose (3,) along the rest of the way."""
        left = self.times[1:-1] > self.place
        left[-1] = True
        return np.concatenate([pose[None, :2], self.way.points[left]])

    def remaining(self) -> float:
        """Time from the robot's place to the end [s]."""
        return self.duration - self.place

    def heading_at(self, time: float) -> float:
        """Heading [rad] at a time [s]."""
        return float(np.interp(time, self.times, self.poses[:, 2]))


def same_side(previous: TimedPath, way: GeometricPath, pose: Array, centres: Array) -> bool:
    """Whether two ways to one goal pass every centre (M, 2) on the same side, in the same gear."""
    if previous.way.reverse != way.reverse:
        return False
    turned = _angle_swept(previous.points_left(pose), centres) - _angle_swept(way.points, centres)
    return bool((np.abs(turned) < np.pi).all())


def _angle_swept(points: Array, centres: Array) -> Array:
    """Angle (M,) by which a way through points (K, 2) goes around each centre [rad]."""
    away = points[:, None] - centres
    angle = np.arctan2(away[..., 1], away[..., 0])
    swept: Array = wrap(np.diff(angle, axis=0)).sum(axis=0)
    return swept
