"""Who walks, as scans show it: small clusters that are followed from step to step and move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import scan_library
from kmpc_lite.control.kernels.tracks import WALKED
from kmpc_lite.control.world.scan import LaserScan, beams
from kmpc_lite.control.world.tracks import Follower, Tracks
from kmpc_lite.geometry import rotate
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight.local_map import LocalMap

GAP = 1.0
"""Distance between neighbouring hits beyond which another cluster begins [radii]."""
LARGEST = 3.0
"""Radius of the largest cluster that may be a pedestrian [radii]."""
WINDOW = 1.0
"""Time over which a cluster's way counts [s]: one that stands for so long is a thing
again."""
SURE = 3.0
"""How many times as much a step counts that leads to where it was seen to be free."""
STRAYED = 0.5
"""How far a cluster must have moved to be a pedestrian, in its own radii: what is seen of a post
changes with the place that it is seen from."""
BEHIND = 1.5
"""How far behind its middle a cluster must have been free, too, in cells: a wall is none."""


def clusters(scan: LaserScan, pose: Array, robot: float, largest: float = LARGEST) -> Array:
    """Circles (N, 5) at rest of the small things that stand free in a scan (`kernels.clusters`).

    `scan`: seen from the pose. `pose`: of the robot (3,). `robot`: its radius [m]. `largest`:
    largest radius of a cluster [radii].
    """
    sizes = abs(scan.angle_increment), GAP * robot, largest * robot
    mount = np.array(scan.mount[:2])
    found = scan_library.clusters(scan.reach, scan.ends, scan.hits, scan.clear, mount, *sizes)
    circles = np.zeros((len(found), 5))
    x, y = rotate(found[:, 0], found[:, 1], float(pose[2]))
    circles[:, 0], circles[:, 1], circles[:, 2] = x + pose[0], y + pose[1], found[:, 2]
    return circles


def walking_tracks(
    tracks: Tracks,
    follower: Follower,
    scans: Sequence[LaserScan],
    poses: Sequence[Array],
    was_free: Callable[[Array], NDArray[np.bool_]] | None = None,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the tracks that walk, in scans that were taken at poses (3,).

    A pedestrian that walks has left its place: that is seen to be free, or hidden behind it. What
    is seen of a wall also seems to move as the robot does, but the wall is still there, and mostly
    nothing was free where it seems to come to, as `was_free` says of places (M, 2). A pedestrian
    counts as walking until nothing has confirmed it for a window: two that walk side by side, or
    past each other, are one cluster for a while. One that comes to where it was free may walk
    though it is not seen to leave a place: another follows it, or it is near and hides it.

    Returns `known`: (W,) indices of tracks that walk; `perhaps`: (P,) of those that have left their
    place, but not for long enough to be sure, or only come to where it was free.
    """
    dt, begins, moving = follower.dt, follower.options.begins, tracks.moving
    gap = GAP * follower.radius
    knew = tracks.walked >= begins
    if not (moving | knew).any():
        tracks.rows[:, WALKED] = 0.0
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    rows = tracks.circles
    velocities, radii = rows[:, 3:], rows[:, 2]
    lasted = np.minimum(tracks.seen - tracks.unseen, WINDOW)
    moved = np.hypot(*velocities.T) * lasted > STRAYED * radii
    is_seen = tracks.unseen == 0.0
    walks = moving & moved
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
            # it may walk over what was seen of itself
            comes[here] = was_free(rows[here, :2])
            faster[here] = np.where(comes[here], SURE, 1.0)
    # a hidden pedestrian walks on for as long as it was seen to
    longer = np.minimum(tracks.walked + faster * dt, begins + WINDOW)
    times = np.where(is_seen, longer, tracks.walked)
    times = np.where(walks, times, np.where(knew, tracks.walked - dt, 0.0))
    tracks.rows[:, WALKED] = times
    known = (times >= begins) & (tracks.unseen <= times)
    perhaps = (walks | comes) & is_seen & ~known
    return np.flatnonzero(known), np.flatnonzero(perhaps)


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
    # one that comes nearer hides where it was: the beam ends at it, well before that place
    ends = scan.ends[beam]
    ends = np.stack(rotate(ends[:, 0], ends[:, 1], heading), axis=1) + pose[:2]
    at_itself = np.hypot(*(ends - rows[:, :2]).T) < rows[:, 2] + gap
    way = np.hypot(*(rows[:, :2] - before).T)
    well_before = scan.reach[beam] < distance - rows[:, 2] - 0.5 * way
    found: NDArray[np.bool_] = passed | (at_itself & well_before)
    return found


def was_free(before: LocalMap | None, places: Array, robot: Array) -> NDArray[np.bool_]:
    """Whether cells at places (M, 2), and behind them as seen from the robot, were seen free.

    A pedestrian that comes nearer hides where its middle is: the cells there were free until it was
    seen in front of them, which is no longer than a window ago.
    """
    if before is None:
        return np.zeros(len(places), dtype=bool)
    away = places - robot
    away *= BEHIND * before.cell / np.maximum(np.hypot(*away.T), before.cell)[:, None]
    cells, inside = before.cells_of(np.concatenate([places, places + away]))
    free = inside & before.was_free(cells, WINDOW)
    return free[: len(places)] & free[len(places) :]
