"""Which paths a robot that is not round fits on: all of its circles, turns on the spot included."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.path_map import distances_around
from kmpc_lite.control.path.search_state import PathSearch
from kmpc_lite.control.path.tangent_graph import GeometricPath
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.path.turning_centre import seen_from
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array


class BodyPaths:
    """Looks at paths that were found for half the robot's width.

    Parameters
    ----------
    problem : NavigationProblem
        Margin.
    footprint : Footprint
        Its own.
    options : GuidanceOptions
        In metres.
    """

    def __init__(
        self, problem: NavigationProblem, footprint: Footprint, options: GuidanceOptions
    ) -> None:
        self._footprint, self._options, self._margin = footprint, options, problem.margin
        self._radius = footprint.circle_radius

    def why_blocked(self, search: PathSearch, tolerance: float) -> str:
        """Why the robot cannot stand within a tolerance [m] of its goal; nothing if it can."""
        distance = float(self._distances(search.target[None], search).min())
        if distance < self._radius:
            return "the goal lies so near to an obstacle that a circle of the footprint touches it"
        if distance < self._radius + self._margin - tolerance:
            return "the goal lies within the margin of an obstacle"
        return ""

    def fits(self, path: GeometricPath, search: PathSearch) -> bool:
        """Whether all circles stay off obstacles along a path, and where it begins and ends."""
        corners = poses_along(path, search.pose, search.goal)
        steps = np.diff(corners, axis=0)
        moved = np.hypot(steps[:, 0], steps[:, 1]) + self._footprint.reach * np.abs(steps[:, 2])
        places = np.concatenate([[0.0], np.cumsum(moved)])
        count = min(2 + math.ceil(places[-1] / (0.5 * self._radius)), self._options.body_samples)
        along = np.linspace(0.0, places[-1], count)
        poses = np.stack([np.interp(along, places, column) for column in corners.T], axis=1)
        if search.centre is not None:
            poses = seen_from(poses, -search.centre)
        distances = self._distances(poses, search)
        # where it stands now, and where it is to stand, it may be as near as it is
        needed = min(self._radius + self._margin, float(distances[0]), float(distances[-1]))
        return bool((distances >= needed - self._options.cut_depth).all())

    def _distances(self, poses: Array, search: PathSearch) -> Array:
        """Least distance (n,) of the circles' middles from obstacles, at poses (n, 3) [m]."""
        points = self._footprint.places(poses).reshape(-1, 2)
        least = distances_around(points, search.circles, search.path_map)
        nearest: Array = least.reshape(len(poses), -1).min(axis=1)
        return nearest
