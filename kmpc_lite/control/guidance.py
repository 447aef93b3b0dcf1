"""A reference around obstacles, so that the controller is never trapped behind one.

The way is the quickest on the tangent graph of the inflated circles; it is looked for anew only when the map, the goal or the
robot's place gives a reason. Between times the robot is located on it, and the poses of the coming stages are read off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.parking import ENTER, LEAVE
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.tangents import Way, quickest_ways
from kmpc_lite.control.timed_path import TimedPath
from kmpc_lite.dictionary import Array

CLEARANCES = (0.06, 0.03, 0.005)
"""Distances beyond the problem's margin that a way keeps [m]; the next one is tried where there is no way."""
SPEED_SHARE = (1.0, 0.9)
"""Share of the bounds at which the way is timed: speed, rate of turn."""
LEAD = 0.2
"""How far the reference runs ahead of the robot [s]."""
OFF_WAY = (0.01, 0.08, 0.15)
"""Distance from the way at which a new one is looked for: least [m], share of the distance to the goal, most [m]."""
PATIENCE = (0.3, 0.8)
"""Least time between two new ways for the same map, and how long the robot may stand still on its way [s]."""
STILL = 0.05
"""Progress along the way that ends a stand [s]."""
MOVED = 0.01
"""How far an obstacle must be from where it was expected to give a reason for a new way [m]."""
FREE_TURN = np.pi / 3
"""How much of the first turn is made while driving on a long way [rad]."""
LONG = 0.5
"""A way over which the whole `FREE_TURN` may be made [m]."""
FLICKER = (0.5, 0.1)
"""How much quicker a way on other sides of obstacles must be to be taken instead: seconds, and share."""


@dataclass(frozen=True, eq=False)
class Guidance:
    """Where to steer."""

    states: Array
    """(N + 1, 3) reference of the stages; headings next to the robot's."""
    reachable: bool
    """Whether there is a way to the goal."""
    path: Array
    """(K, 2) points of the way from where it was planned to the goal [m]; the robot's own place where there is none."""
    time_left: float
    """Until the goal is reached [s]; infinite where it cannot be."""
    refreshed: bool
    """Whether the way was looked for anew in this step."""
    switched: bool
    """Whether the new way passes an obstacle on another side, so that a plan along the old one is no good start."""


class Guide:
    """Finds ways, and keeps to one.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, radius and margin, horizon and period.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        u_min, u_max, x_min, x_max = problem.bounds
        self._keep = problem.robot_radius + problem.margin
        self._radius = problem.robot_radius
        self._area = np.concatenate([x_min[:2], x_max[:2]])
        self._speed = np.array(SPEED_SHARE) * (min(u_max[0], max(-u_min[0], 0.0)) or u_max[0], min(u_max[1], -u_min[1]))
        self._can_reverse = u_min[0] < 0.0
        self._times = problem.dt * np.arange(problem.horizon + 1)
        self._dt = problem.dt
        self.reset()

    def reset(self) -> None:
        """Forget the way."""
        self._path: TimedPath | None = None
        self._goal = np.full(3, np.nan)
        self._circles = np.empty((0, 5))
        self._age = 0.0
        self._turning = False
        self._waiting: Array | None = None
        self._furthest = self._still = 0.0
        self._stuck = False

    def reference(self, pose: Array, goal: Array, circles: Array) -> Guidance:
        """Give the reference of the coming stages.

        Parameters
        ----------
        pose, goal : ndarray
            Poses (3,) [m, m, rad].
        circles : ndarray
            (M, 5) rows x, y, radius, vx, vy, now.
        """
        self._age += self._dt
        distance = float(np.hypot(goal[0] - pose[0], goal[1] - pose[1]))
        self._turning = distance <= (LEAVE[0] if self._turning else ENTER[0])
        refreshed = switched = False
        place, off = (0.0, 0.0) if self._path is None else self._path.locate(pose)
        if self._needs_way(goal, circles, off, place, distance):
            switched = self._refresh(pose, goal, circles)
            refreshed = True
            if self._path is not None:
                place, off = self._path.locate(pose)
        path = self._path
        if path is None:
            wait = pose if self._waiting is None else self._waiting
            states = np.tile(np.array([wait[0], wait[1], pose[2]]), (len(self._times), 1))
            return Guidance(states, False, wait[None, :2], np.inf, refreshed, switched)
        if self._turning:
            place = path.place = max(place, path.drive_end)
        else:
            place = path.place = min(place, path.drive_end)
        times = place + LEAD + self._times
        if not self._turning and place > path.drive_end - 0.5:
            np.minimum(times, path.drive_end, out=times)
        states = path.at(times)
        nearest = path.heading_at(place)
        states[:, 2] += 2 * np.pi * np.round((pose[2] - nearest) / (2 * np.pi))
        return Guidance(states, True, path.points, path.duration - place, refreshed, switched)

    def _needs_way(self, goal: Array, circles: Array, off: float, place: float, distance: float) -> bool:
        if not np.array_equal(goal, self._goal) or len(circles) != len(self._circles):
            return True
        if len(circles):
            expected = self._circles[:, :2] + self._age * self._circles[:, 3:]
            if np.abs(circles[:, :2] - expected).max() > MOVED or not np.array_equal(circles[:, 2], self._circles[:, 2]):
                return True
        if self._path is None:
            return self._age > 0.5
        if self._turning:
            return False
        if place > self._furthest + STILL:
            self._furthest, self._still = place, 0.0
        self._still += self._dt
        self._stuck = self._still > PATIENCE[1]
        if self._stuck:
            return True
        least, share, most = OFF_WAY
        return self._age > PATIENCE[0] and off > min(max(least, share * distance), most)

    def _refresh(self, pose: Array, goal: Array, circles: Array) -> bool:
        """Look for a way; return whether it passes obstacles on other sides than the one before."""
        previous = self._path
        self._goal, self._circles, self._age = goal.copy(), circles.copy(), 0.0
        self._furthest = self._still = 0.0
        way = self._find(pose, goal, circles)
        if way is None:
            if self._waiting is None:
                self._waiting = pose.copy()
            self._path = None
            return previous is not None
        self._waiting = None
        length = float(np.hypot(*np.diff(way.points, axis=0).T).sum())
        # a robot that is stuck turns on the spot before it drives
        free = 0.0 if self._stuck else FREE_TURN * min(1.0, length / LONG)
        self._path = TimedPath(way, pose, goal, self._speed, free)
        return previous is not None and self._other_sides(previous, self._path, circles)

    def _find(self, pose: Array, goal: Array, circles: Array) -> Way | None:
        for clearance in CLEARANCES:
            centres, radii = circles[:, :2], circles[:, 2] + self._keep + clearance
            for point in (pose, goal):
                away = np.hypot(*(centres - point[:2]).T)
                if point is goal and (away < circles[:, 2] + self._radius).any():
                    return None
                radii = np.minimum(radii, np.maximum(away - 1e-3, 0.0))
            area = self._area.copy()
            area[:2] = np.minimum(area[:2], np.minimum(pose[:2], goal[:2]))
            area[2:] = np.maximum(area[2:], np.maximum(pose[:2], goal[:2]))
            way = next(quickest_ways(centres, radii, pose, goal, area, self._speed), None)
            if way is not None:
                return way
        return None

    def _other_sides(self, old: TimedPath, new: TimedPath, circles: Array) -> bool:
        return False
