"""Which paths a robot that is not round fits on: all of its circles, turns on the spot included."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.planner import PathRequest
from kmpc_lite.control.path.tangent_graph import GeometricPath
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.path.turning_centre import seen_from
from kmpc_lite.control.problem import NavigationProblem


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

    def fits(self, path: GeometricPath, request: PathRequest) -> bool:
        """Whether all circles stay off obstacles along a path, and where it begins and ends."""
        corners = poses_along(path, request.start, request.goal)
        steps = np.diff(corners, axis=0)
        moved = np.hypot(steps[:, 0], steps[:, 1]) + self._footprint.reach * np.abs(steps[:, 2])
        places = np.concatenate([[0.0], np.cumsum(moved)])
        count = min(2 + math.ceil(places[-1] / (0.5 * self._radius)), self._options.body_samples)
        along = np.linspace(0.0, places[-1], count)
        poses = np.stack([np.interp(along, places, column) for column in corners.T], axis=1)
        if request.centre is not None:
            poses = seen_from(poses, -request.centre)
        points = self._footprint.places(poses).reshape(-1, 2)
        distances = request.distances(points).reshape(len(poses), -1).min(axis=1)
        # where it stands now, and where it is to stand, it may be as near as it is
        needed = min(self._radius + self._margin, float(distances[0]), float(distances[-1]))
        return bool((distances >= needed - self._options.cut_depth).all())
