"""Follows circles from step to step: which one is which, and how fast each moves.

A circle that comes from a camera, a lidar or a list without velocities stands for the controller,
though it may walk.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.shapes import Circle, circles_to_array
from kmpc_lite.control.world.tracks import Follower, Tracks, clusters, walking_tracks
from kmpc_lite.errors import ProblemError
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED
from kmpc_lite.types import Array


class ObstacleTracker:
    """Gives circles the velocity that they were seen to have.

    Parameters
    ----------
    dt : float
        Time between two updates [s].
    options : TrackerOptions, optional
        Noise of the sensor, accelerations, gate, how long a hidden circle is remembered.
    radius, speed : float
        Of the robot that the options are multiples of [m, m/s].

    Attributes
    ----------
    tracks : Tracks
        What is followed, with its uncertainty. A copy of it, assigned later, goes back to then.

    Raises
    ------
    ProblemError
        For a period, radius or speed that is none.

    Examples
    --------
    >>> tracker = ObstacleTracker(0.1)
    >>> for k in range(6):
    ...     seen = tracker.update([Circle(0.05 * k, 1.0, 0.2), Circle(2.0, 0.0, 0.2)])
    >>> [(round(c.vx, 2), round(c.vy, 2)) for c in seen]
    [(0.5, 0.0), (0.0, 0.0)]
    """

    def __init__(
        self,
        dt: float,
        options: TrackerOptions | None = None,
        radius: float = UNIT_RADIUS,
        speed: float = UNIT_SPEED,
    ) -> None:
        for name, value in (("dt", dt), ("radius", radius), ("speed", speed)):
            if not (math.isfinite(value) and value > 0.0):
                raise ProblemError(f"{name}: expected a number > 0, got {value!r}")
        self._follower = Follower(dt, options or TrackerOptions(), radius, speed)
        self.tracks = Tracks()

    def reset(self) -> None:
        """Forget all circles."""
        self.tracks = Tracks()

    def update(self, circles: Sequence[Circle] | ArrayLike) -> list[Circle]:
        """Take in the circles of a period.

        Parameters
        ----------
        circles : sequence of Circle, or array_like
            Where they are now, in any order; an array has rows x, y, radius or x, y, radius, vx,
            vy. A velocity that is told is kept until the circle is seen to have another one.

        Returns
        -------
        list of Circle
            The same circles in the same order, with velocities; then those that are hidden, where
            they should be. To be handed to `Controller.step`.

        Raises
        ------
        ValueError
            For other shapes, or values that are not finite.
        """
        array = circles_to_array(circles)
        if not np.isfinite(array).all():
            raise ValueError("circles: expected finite numbers")
        followed = self.follow(array)
        velocities, known = self.tracks.velocities, followed >= 0
        array = array.copy()
        array[known, 3:] = velocities[followed[known]]
        hidden = self.tracks.unseen > 0.0
        rest = self.tracks.circles[hidden]
        rest[:, 3:] = velocities[hidden]
        return [Circle(*row) for row in np.vstack([array, rest]).tolist()]

    def see(self, scan: LaserScan, pose: ArrayLike) -> list[Circle]:
        """Find the pedestrians that walk in the scan of a period; instead of `update`.

        Parameters
        ----------
        scan : LaserScan
            Seen from the pose.
        pose : array_like
            Of the robot (3,) [m, m, rad].

        Returns
        -------
        list of Circle
            Small clusters of hits that move, with their velocity; then those that are hidden. To
            be handed to `Controller.step` beside the scan, which tells all that stands.

        Raises
        ------
        ValueError
            For a pose of another shape.
        """
        here = np.asarray(pose, dtype=float)
        if here.shape != (3,):
            raise ValueError(f"pose: expected shape (3,), got {here.shape}")
        found = clusters(scan, here, self._follower.radius)
        self.follow(found)
        known, _ = walking_tracks(self.tracks, self._follower, [scan], [here])
        return [Circle(*row) for row in self.tracks.circles[known].tolist()]

    def follow(self, circles: Array) -> Array:
        """Take in circles (N, 5); give the index of each one's track (N,), -1 for too many."""
        self.tracks, found = self._follower.follow(self.tracks, circles)
        return found
