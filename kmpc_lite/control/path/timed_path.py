"""A path as poses over time: how fast the robot can drive it, and where on it the robot is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.records import Timed, poses_at
from kmpc_lite.control.path.planner import Path, Route
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.taut_string import GeometricPath

GRID_STEP = 0.05
"""Time between neighbouring poses of a path, among which the robot's place is looked for [s]."""
FINE_STEP = 0.01
"""The same of a car's path [s]."""
DECELERATION = 2.0
"""With which a car's path brakes where it ends or its gear changes: motors may lag unknown to the
model [m/s^2]."""
GRID_POSES = 20_000
"""Most poses of one path: the path of a robot that hardly moves would need more than there is
memory for."""
INSTANT = 1e-9
"""Time between two poses that are the same [s]: times must grow."""
AT_GOAL = 1e-6
"""Distance that rounding leaves to the goal [m]."""


class TimedPath:
    """A path as it is driven (`timed`); it does not change.

    `path`: poses, and times where the planner has timed them. `speed`: speed [m/s] and rate of turn
    [rad/s] to drive at, (2,). `free_turn`: part of the first turn that is left to the controller,
    to be made while driving [rad]. `wheels`: how far a wheel drives for each radian that the robot
    turns [m], and its fastest speed [m/s]. `deceleration`: with which the drive ends [m/s^2];
    infinite if the robot stands at once.
    """

    def __init__(
        self,
        path: Path,
        speed: Array,
        free_turn: float = 0.0,
        wheels: tuple[float, float] = (0.0, math.inf),
        deceleration: float = math.inf,
    ) -> None:
        self.clearance = path.clearance
        path = path.between_turns
        gears = self._gears = path.gears
        # what turns on the spot, or drives sideways, has other pieces
        by_poses = path.times is not None and bool(gears[1:-1].all())
        if by_poses:
            deceleration = min(deceleration, DECELERATION)
        poses = path.poses.copy()
        first = float(wrap(poses[1, 2] - poses[0, 2]))
        skipped = min(free_turn, abs(first))
        poses[0, 2] = poses[1, 2] - math.copysign(abs(first) - skipped, first)
        steps = np.diff(poses, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        turns = np.abs(steps[:, 2])
        needed = np.maximum(lengths / speed[0], turns / speed[1])
        # the outer wheel drives both
        needed = np.maximum(needed, (lengths + wheels[0] * turns) / wheels[1])
        if path.times is not None:
            needed = np.diff(path.times)
            needed[0] -= skipped / speed[1]  # left to the controller
        times = np.concatenate([[0.0], np.cumsum(np.maximum(needed, INSTANT))])
        self.reverse = bool((gears < 0).sum() > (gears > 0).sum())
        """Whether most of it is driven backwards."""
        moved = np.flatnonzero(gears)
        changed = moved[1:][gears[moved[1:]] != gears[moved[:-1]]]
        self.duration = float(times[-1])
        self.drive_end = float(times[-2])
        """When the goal's position is reached, and the last turn begins [s]."""
        step = max(FINE_STEP if by_poses else GRID_STEP, self.duration / GRID_POSES)
        braking = float(speed[0]) / deceleration
        self.timed = Timed(poses, times, times[changed], step, braking)

    @property
    def points(self) -> Array:
        """The path's points (K, 2) [m]."""
        return self.timed.poses[1:-1, :2]

    def at(self, times: Array) -> Array:
        """Poses (n, 3) at times (n,) [s]; the ends are held."""
        return poses_at(self.timed, times)

    def gear_at(self, time: float) -> int:
        """Gear, 1 or -1, of what is driven after a time [s]."""
        after = self.timed.times[1:] > time + INSTANT
        return int(next(iter(self._gears[after & (self._gears != 0)]), 1))

    def share_at_goal(self, states: Array) -> float:
        """Share of the stages 1 to N of a reference (N + 1, 3) that have come to its goal."""
        away = np.maximum.reduce(np.abs(states[1:, :2] - self.timed.poses[-1, :2]), axis=1)
        return int(np.count_nonzero(away <= AT_GOAL)) / len(away)

    def route(self, pose: Array, place: float, lost: float) -> Route:
        """What is left of it for a robot at a pose (3,), after its place; time was lost [s]."""
        left = self.timed.times[1:-1] > place
        left[-1:] = True  # none between two poses
        points = np.concatenate([pose[None, :2], self.points[left]])
        return Route(points, self.reverse, self.clearance, lost)


def poses_along(geometry: GeometricPath, start: Array, goal: Array) -> Array:
    """Poses (K + 2, 3): the path's points between a turn at the start and one at the goal."""
    headings = geometry.headings + (math.pi if geometry.reverse else 0.0)
    first = float(wrap(headings[0] - start[2]))
    last = float(wrap(goal[2] - headings[-1]))
    headings = headings + (start[2] + first - headings[0])
    poses = np.empty((len(headings) + 2, 3))
    poses[1:-1, :2], poses[1:-1, 2] = geometry.points, headings
    poses[0] = (*geometry.points[0], start[2])
    poses[-1] = (goal[0], goal[1], headings[-1] + last)
    return poses
