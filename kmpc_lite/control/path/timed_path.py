"""A path as poses over time: how fast the robot can drive it, and where on it the robot is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.path.planner import Path, Route
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.tangent_graph import GeometricPath

GRID_STEP = 0.05
"""Time between neighbouring poses of a path, among which the robot's place is looked for [s]."""
GRID_POSES = 20_000
"""Most poses of one path: the path of a robot that hardly moves would need more than there is
memory for."""
TURN_LENGTH = 0.3
"""One radian of heading counts as much as this distance when the robot's place on its path is
looked for [m]."""
LOCATE_BACK = 0.5
"""How far back along its path the robot's place may move in one step [s]."""
LOCATE_AHEAD = 1.5
"""How far ahead along its path the robot's place may move in one step [s]."""

INSTANT = 1e-9
"""Time between two poses that are the same [s]: times must grow."""
AT_GOAL = 1e-6
"""Distance that rounding leaves to the goal [m]."""


class TimedPath:
    """Poses along a path, at the times at which they can be reached; it does not change.

    Parameters
    ----------
    path : Path
        Poses, and times where the planner has timed them.
    speed : ndarray
        Speed [m/s] and rate of turn [rad/s] to drive at, (2,).
    free_turn : float
        Part of the first turn that is left to the controller, to be made while driving [rad].
    wheels : tuple
        How far a wheel drives for each radian that the robot turns [m], and its fastest speed
        [m/s].
    deceleration : float
        With which the drive ends [m/s^2]; infinite if the robot stands at once.
    """

    def __init__(
        self,
        path: Path,
        speed: Array,
        free_turn: float = 0.0,
        wheels: tuple[float, float] = (0.0, math.inf),
        deceleration: float = math.inf,
    ) -> None:
        self._braking, self.clearance = float(speed[0]) / deceleration, path.clearance
        path = path.between_turns
        self.poses = path.poses.copy()
        first = float(wrap(self.poses[1, 2] - self.poses[0, 2]))
        skipped = min(free_turn, abs(first))
        self.poses[0, 2] = self.poses[1, 2] - math.copysign(abs(first) - skipped, first)
        steps = np.diff(self.poses, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        turns = np.abs(steps[:, 2])
        needed = np.maximum(lengths / speed[0], turns / speed[1])
        # the outer wheel drives both
        needed = np.maximum(needed, (lengths + wheels[0] * turns) / wheels[1])
        if path.times is not None:
            needed = np.diff(path.times)
            needed[0] -= skipped / speed[1]  # left to the controller
        self.times = np.concatenate([[0.0], np.cumsum(np.maximum(needed, INSTANT))])
        gears = path.gears
        self.reverse = bool((gears < 0).sum() > (gears > 0).sum())
        """Whether most of it is driven backwards."""
        moved = np.flatnonzero(gears)
        changed = moved[1:][gears[moved[1:]] != gears[moved[:-1]]]
        self.cusps = self.times[changed]
        """When the robot stops and drives on in the other gear, (n,) [s]."""
        # as complex numbers, for both coordinates are interpolated in the time of one
        self._places = self.poses[:, 0] + 1j * self.poses[:, 1]
        self.duration = float(self.times[-1])
        self.drive_end = float(self.times[-2])
        """When the goal's position is reached, and the last turn begins [s]."""
        self._grid_step = max(GRID_STEP, self.duration / GRID_POSES)
        times = np.append(np.arange(0.0, self.duration, self._grid_step), self.duration)
        self._grid = self.at(times) * (1.0, 1.0, TURN_LENGTH)

    @property
    def points(self) -> Array:
        """The path's points (K, 2) [m]."""
        return self.poses[1:-1, :2]

    def at(self, times: Array) -> Array:
        """Poses (n, 3) at times (n,) [s]; the ends are held."""
        poses = np.empty((len(times), 3))
        places = np.interp(times, self.times, self._places)
        poses[:, :2] = places.view(float).reshape(-1, 2)
        poses[:, 2] = np.interp(times, self.times, self.poses[:, 2])
        return poses

    def times_after(self, place: float, later: Array) -> Array:
        """Times on the path of a robot that is at a place [s] and drives on, braking at the end.

        On its times alone a path ends at full speed: one that brakes before it has braked too late.

        Parameters
        ----------
        place : float
            Where it is [s], before the last turn.
        later : ndarray
            How much later, (n,) [s].
        """
        left, braking = self.drive_end - place, self._braking
        if left <= 0.0 or braking == 0.0:
            return place + later
        # with a constant deceleration the root of the time that is left shrinks evenly
        root, rate = math.sqrt(min(left, 0.5 * braking)), 1.0 / math.sqrt(2.0 * braking)
        slowed = later - max(left - 0.5 * braking, 0.0)
        times: Array = np.where(
            slowed <= 0.0,
            place + later,
            self.drive_end - np.maximum(root - rate * slowed, 0.0) ** 2,
        )
        return times + np.maximum(slowed - root / rate, 0.0)

    def leg_end(self, begin: float) -> float:
        """When the gear changes next after a time [s]; infinite if it does not."""
        later = self.cusps[self.cusps > begin]
        return float(later[0]) if len(later) else math.inf

    def share_at_goal(self, states: Array) -> float:
        """Share of the stages 1 to N of a reference (N + 1, 3) that have come to its goal."""
        away = np.abs(states[1:, :2] - self.poses[-1, :2])
        return float((away <= AT_GOAL).all(axis=1).mean())

    def locate(self, pose: Array, place: float, least: float = 0.0) -> tuple[float, float]:
        """Find the robot's place: the time of the path's pose that is nearest.

        Parameters
        ----------
        pose : ndarray
            The robot's pose (3,).
        place : float
            Where it was found last [s]; only places near it are looked at.
        least : float
            Where it must have come to [s].

        Returns
        -------
        place, off : float
            The time on the path [s], and the distance from its pose there [m].
        """
        last = max(place, least)
        begin = int(max(place - LOCATE_BACK, least) / self._grid_step)
        begin += len(self.cusps) > 0  # the pose before a change of gear is not on this leg
        begin = min(begin, len(self._grid) - 1)
        end = int(min(last + LOCATE_AHEAD, self.leg_end(least)) / self._grid_step) + 2
        x, y, heading = pose.tolist()
        # next to the heading at the last place: the robot has not turned by half a circle since
        before = self._grid.item(int(last / self._grid_step), 2) / TURN_LENGTH
        heading -= math.tau * round((heading - before) / math.tau)
        error = self._grid[begin:end] - (x, y, TURN_LENGTH * heading)
        nearest = int(np.einsum("ni,ni->n", error, error).argmin())
        found = min((begin + nearest) * self._grid_step, self.duration)
        return found, math.hypot(error.item(nearest, 0), error.item(nearest, 1))

    def route(self, pose: Array, place: float, lost: float) -> Route:
        """What is left of it for a robot at a pose (3,), after its place; time was lost [s]."""
        left = self.times[1:-1] > place
        left[-1] = True
        points = np.concatenate([pose[None, :2], self.points[left]])
        return Route(points, self.reverse, self.clearance, lost)

    def heading_at(self, time: float) -> float:
        """Heading [rad] at a time [s]."""
        after = min(max(int(self.times.searchsorted(time, "right")), 1), len(self.times) - 1)
        begin, end = self.times.item(after - 1), self.times.item(after)
        before, turned = self.poses.item(after - 1, 2), self.poses.item(after, 2)
        share = min(max((time - begin) / (end - begin), 0.0), 1.0)
        return float(before + share * (turned - before))


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
