"""Who walks, as scans show it: small clusters that are followed from step to step and move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels.clearance import distances, things_of
from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.control.world.clusters import GAP, clusters
from kmpc_lite.control.world.scan import LaserScan, beams
from kmpc_lite.control.world.sight.local_map import LocalMap
from kmpc_lite.control.world.tracks import Follower, Tracks
from kmpc_lite.geometry import rotate
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED, Scale
from kmpc_lite.types import Array

WINDOW = 1.0
"""Time over which a cluster's way counts [s]: who has walked and stands for so long is a thing
again."""

SURE = 3.0
"""How many times as much a step of somebody counts who comes to where it was seen to be free."""
STRAYED = 0.5
"""How far a cluster must have moved to be somebody, in its own radii: what is seen of a post
changes with the place that it is seen from."""
BEHIND = 1.5
"""How far behind its middle a cluster must have been free, too, in cells: a wall is none."""


class Walking(NamedTuple):
    """Circles of tracks that walk, and of those that seem to."""

    rows: Array
    """(M, 5) who walks."""
    deviations: Array
    """(M,) of their velocities."""
    perhaps: Array
    """(P, 5) who has left the place where he was, but not for long enough to be sure, or only comes
    to where it was free."""


NOBODY = Walking(np.empty((0, 5)), np.empty(0), np.empty((0, 5)))


def who_walks(
    tracks: Tracks,
    follower: Follower,
    scans: Sequence[LaserScan],
    poses: Sequence[Array],
    was_free: Callable[[Array], NDArray[np.bool_]] | None = None,
) -> Walking:
    """Find the circles of tracks that walk, in scans that were taken at poses (3,).

    Whoever walks has left the place where he was: it is seen to be free, or hidden behind himself.
    What is seen of a wall also seems to move as the robot does, but the wall is still there, and
    mostly nothing was free where it seems to come to, as `was_free` tells of circles (M, 5).
    Whoever was seen to walk does so until nothing has told of it for a window: two who walk side by
    side, or past each other, are one cluster for a while. Who comes to where it was free may walk
    though he is not seen to leave a place: somebody follows him, or he is near and hides it.
    """
    dt, begins = follower.dt, follower.options.begins
    gap = GAP * follower.radius
    knew = tracks.walked >= begins
    if not (tracks.moving | knew).any():
        tracks.walked = np.zeros(len(tracks))
        return NOBODY
    velocities = tracks.states[:, 2:4]
    lasted = np.minimum(tracks.seen - tracks.unseen, WINDOW)
    moved = np.hypot(*velocities.T) * lasted > STRAYED * tracks.radii
    rows = np.hstack([tracks.states[:, :2], tracks.radii[:, None], velocities])
    is_seen = tracks.unseen == 0.0
    walks = tracks.moving & moved
    comes = np.zeros(len(tracks), dtype=bool)
    here, faster = np.flatnonzero(walks & is_seen), np.full(len(tracks), SURE)
    if len(here):
        before = rows[here, :2] - lasted[here, None] * velocities[here]
        left = [
            _has_left(scan, pose, rows[here], before, gap)
            for scan, pose in zip(scans, poses, strict=True)
        ]
        walks[here] = np.any(left, axis=0)
        if was_free is not None:
            # he may walk over what was seen of himself
            comes[here] = was_free(rows[here])
            faster[here] = np.where(comes[here], SURE, 1.0)
    # who is hidden walks on for as long as he was seen to
    longer = np.minimum(tracks.walked + faster * dt, begins + WINDOW)
    times = np.where(is_seen, longer, tracks.walked)
    tracks.walked = np.where(walks, times, np.where(knew, tracks.walked - dt, 0.0))
    known = (tracks.walked >= begins) & (tracks.unseen <= tracks.walked)
    perhaps = (walks | comes) & is_seen & ~known
    return Walking(rows[known], tracks.velocity_deviations[known], rows[perhaps])


def _has_left(
    scan: LaserScan, pose: Array, rows: Array, before: Array, gap: float
) -> NDArray[np.bool_]:
    """Whether a scan shows the places (M, 2) where circles (M, 5) were to be left."""
    told = np.flatnonzero(~scan.unknown)
    if not len(told):
        return np.zeros(len(rows), dtype=bool)
    heading, away = float(pose[2]), before - pose[:2]
    x, y = rotate(away[:, 0], away[:, 1], -heading)
    x, y = x - scan.mount[0], y - scan.mount[1]
    along = beams(*scan.layout)[1].take(told, axis=0)
    beam = told[(along @ np.stack([x, y])).argmax(axis=0)]
    distance = np.hypot(x, y)
    passed = scan.reach[beam] > distance + rows[:, 2]
    # who comes nearer hides where he was: the beam ends at himself, well before that place
    ends = scan.ends[beam]
    ends = np.stack(rotate(ends[:, 0], ends[:, 1], heading), axis=1) + pose[:2]
    at_himself = np.hypot(*(ends - rows[:, :2]).T) < rows[:, 2] + gap
    way = np.hypot(*(rows[:, :2] - before).T)
    well_before = scan.reach[beam] < distance - rows[:, 2] - 0.5 * way
    found: NDArray[np.bool_] = passed | (at_himself & well_before)
    return found


def _was_free(
    before: LocalMap | None, places: Array, robot: Array, window: float
) -> NDArray[np.bool_]:
    """Whether cells at places (M, 2), and behind them as seen from the robot, were seen free.

    Whoever comes nearer hides where his middle is: the cells there were free until he was seen in
    front of them, which is no longer than a window ago.
    """
    if before is None:
        return np.zeros(len(places), dtype=bool)
    away = places - robot
    away *= BEHIND * before.cell / np.maximum(np.hypot(*away.T), before.cell)[:, None]
    cells, inside = before.cells_of(np.concatenate([places, places + away]))
    free = inside & before.was_free(cells, window)
    return free[: len(places)] & free[len(places) :]


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
    spread_max : float
        How far what moves spreads at the most, in units.
    """

    def __init__(self, dt: float, options: TrackerOptions, scale: Scale, spread_max: float) -> None:
        self._scale, self._spread_max = scale, spread_max
        radius, speed = scale.length * UNIT_RADIUS, scale.speed * UNIT_SPEED
        self._follower = Follower(dt, options, radius, speed)

    def see(
        self,
        tracks: Tracks,
        scans: Sequence[LaserScan],
        pose: Array,
        known: Array,
        before: LocalMap | None,
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
        known : ndarray
            (M, 7) what was given, in the robot's units: what is among it is not given twice.
        before : LocalMap or None
            What the scans before have shown.

        Returns
        -------
        tracks : Tracks
            A period later.
        walkers : ndarray
            (W, 7) things that walk, in the robot's units.
        perhaps : ndarray
            (P, 7) what seems to walk, but may be a piece of something that stands.
        """
        options, scale = self._follower.options, self._scale
        taken = [self._taken_at(scan, pose, before) * scale.state for scan in scans]
        found = [
            clusters(scan, at, self._follower.radius) for scan, at in zip(scans, taken, strict=True)
        ]
        seen = found[0] if len(found) == 1 else np.concatenate([np.empty((0, 3)), *found])
        if not len(seen) and not len(tracks):
            return tracks, things_of(NOBODY.rows), things_of(NOBODY.perhaps)
        standing = np.zeros((len(seen), 5))
        standing[:, :3] = seen
        tracks, _ = self._follower.follow(tracks, standing)
        length = scale.length

        def was_free(rows: Array) -> NDArray[np.bool_]:
            return _was_free(before, rows[:, :2] / length, pose[:2], WINDOW / scale.time)

        rows, deviations, perhaps = who_walks(tracks, self._follower, scans, taken, was_free)
        rows, perhaps = rows / scale.circle, perhaps / scale.circle
        spread = options.spread * deviations / scale.speed
        if len(known) and len(rows):
            new = (distances(known, rows[:, :2], np.zeros(len(rows))) > rows[:, 2:3]).all(axis=1)
            rows, spread = rows[new], spread[new]
        return tracks, things_of(rows, spread, self._spread_max), things_of(perhaps)

    def _taken_at(self, scan: LaserScan, pose: Array, before: LocalMap | None) -> Array:
        """Where the robot, that is at a pose (3,) now, was in the middle of a scan."""
        if before is None or not (scan.age or scan.time_increment):
            return pose
        age = 0.5 * float(scan.ages[0] + scan.ages[-1]) / self._scale.time
        return before.poses_at(np.array(age), self._follower.dt / self._scale.time, pose)
