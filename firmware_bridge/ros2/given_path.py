"""The path of another planner, Nav2's for one, as kmpc_lite's controller follows it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

import kmpc_lite as kl
from firmware_bridge.ros2.geometry import Place

SPACING = 0.1
"""Of the poses that are followed [m]: grids' planners give one a cell, with the cells' corners."""
CLOSE, WOBBLE = 1e-4, 0.02
"""Points nearer to each other are one [m]; the path is smoothed by so much [m]: half a usual cell.
"""
END = 0.05
"""A path that ends farther from the goal leads elsewhere [m]."""
NONE = "no path to this goal on the topic plan"


class GivenPath:
    """A planner that finds what another one has published.

    `places`: gives the newest path, in the frame that is driven in. `by_poses`: whether its
    headings count, as a car's; else a robot looks where it drives.
    """

    def __init__(self, places: Callable[[], Sequence[Place]], by_poses: bool) -> None:
        self._places, self._by_poses = places, by_poses
        self._found: kl.Path | str = NONE

    def begin(self, request: kl.PathRequest) -> None:
        """Take the part of the path that lies before the robot."""
        poses = np.array([place[:3] for place in self._places()]).reshape(-1, 3)
        self._found = NONE
        if len(poses) < 2 or np.hypot(*(poses[-1] - request.goal)[:2]) > END:
            return
        nearest = int(np.hypot(*(poses[:, :2] - request.start[:2]).T).argmin())
        rest = np.vstack([request.start, poses[nearest + 1 :], request.goal])
        if not self._by_poses:
            rest = _looking_ahead(rest)
        rest[:, 2] = np.unwrap(rest[:, 2])
        if len(rest) < 2:
            return
        clear = request.distances(rest[1:-1, :2]) - request.inflation
        if clear.min(initial=np.inf) < 0.0:
            self._found = "something stands on the path of the topic plan"
            return
        self._found = kl.Path(rest, clearance=float(min(clear.min(initial=1.0), 1.0)))

    def advance(self, quanta: int) -> int:
        """Nothing is left to do."""
        return 0

    def path(self) -> kl.Path | str:
        """The path, or why there is none."""
        return self._found


def _looking_ahead(poses: np.ndarray) -> np.ndarray:
    """Poses `SPACING` apart, each looking along the path; turns on the spot at either end."""
    from scipy.interpolate import splev, splprep

    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    points = poses[np.concatenate([[True], steps > CLOSE]), :2]
    if len(points) < 2:
        return poses
    degree = min(3, len(points) - 1)
    spline, along = splprep(points.T, k=degree, s=len(points) * WOBBLE**2)
    count = max(int(steps.sum() / SPACING), 1)
    even = np.linspace(along[0], along[-1], count + 1)
    places, slopes = (np.column_stack(splev(even, spline, der=order)) for order in (0, 1))
    places[0], places[-1] = poses[0, :2], poses[-1, :2]
    headings = np.arctan2(slopes[:, 1], slopes[:, 0])
    return np.vstack([poses[:1], np.column_stack([places, headings]), poses[-1:]])
