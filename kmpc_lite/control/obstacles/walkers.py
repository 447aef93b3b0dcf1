"""Who walks, as scans show it: small clusters that are followed from step to step and move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmpc_lite.control.obstacles.clusters import clusters
from kmpc_lite.control.obstacles.scan import LaserScan
from kmpc_lite.control.obstacles.tracks import Follower, Tracks
from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED, Scale
from kmpc_lite.types import Array

WINDOW = 1.0
"""Time over which a cluster's way counts [s]: who has walked and stands is a thing again."""


def who_walks(tracks: Tracks, options: TrackerOptions) -> tuple[Array, Array]:
    """Circles of tracks that walk (M, 5), and the standard deviations of their velocities (M,)."""
    velocities = tracks.velocities
    walked = np.hypot(*velocities.T) * np.minimum(tracks.seen - tracks.unseen, WINDOW)
    walks = tracks.moving & (walked > options.strayed * tracks.radii)
    if not walks.any():
        return np.empty((0, 5)), np.empty(0)
    rows = np.hstack([tracks.states[:, :2], tracks.radii[:, None], velocities])[walks]
    return rows, tracks.velocity_deviations[walks]


class Walkers:
    """Finds who walks in the scans of a controller; it remembers nothing itself.

    Parameters
    ----------
    dt : float
        Period [s].
    options : TrackerOptions
        What may be somebody, and when he counts as walking.
    scale : Scale
        The robot's units; scans, poses and tracks are in metres and seconds.
    """

    def __init__(self, dt: float, options: TrackerOptions, scale: Scale) -> None:
        self._scale = scale
        radius, speed = scale.length * UNIT_RADIUS, scale.speed * UNIT_SPEED
        self._follower = Follower(dt, options, radius, speed)

    def see(
        self, tracks: Tracks, scans: Sequence[LaserScan], pose: Array, circles: Array
    ) -> tuple[Tracks, Array, Array]:
        """Take in the scans of a step.

        Parameters
        ----------
        tracks : Tracks
            Of the step before.
        scans : sequence of LaserScan
            Seen from the pose.
        pose : ndarray
            Of the robot (3,), in the robot's units.
        circles : ndarray
            (M, 5) what was told, in the robot's units: who is among them is not told twice.

        Returns
        -------
        tracks : Tracks
            A period later.
        walkers : ndarray
            (W, 5) who walks, in the robot's units.
        spread : ndarray
            (W,) speeds at which they grow for what is not known of their velocity.
        """
        options, scale = self._follower.options, self._scale
        here = pose * scale.state
        found = [
            clusters(scan, here, options.gap, options.largest_cluster, options.fewest_hits)
            for scan in scans
        ]
        seen = np.concatenate(found) if found else np.empty((0, 3))
        if not len(seen) and not len(tracks):
            return tracks, np.empty((0, 5)), np.empty(0)
        tracks, _ = self._follower.follow(tracks, np.hstack([seen, np.zeros((len(seen), 2))]))
        rows, deviations = who_walks(tracks, options)
        rows = rows / scale.circle
        spread = options.spread * deviations / scale.speed
        if len(rows) and len(circles):
            away = np.hypot(*(rows[:, None, :2] - circles[:, :2]).transpose(2, 0, 1))
            new = (away > rows[:, 2:3] + circles[:, 2]).all(axis=1)
            rows, spread = rows[new], spread[new]
        return tracks, rows, spread
