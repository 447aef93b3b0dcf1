"""Small things that stand free in a scan, as circles: legs, people, posts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.geometry import rotate
from kmpc_lite.types import Array

GAP = 1.0
"""Distance between neighbouring hits beyond which another cluster begins [radii]."""
LARGEST = 3.0
"""Radius of the largest cluster that may be somebody [radii]."""
FEWEST = 3
"""Hits of the smallest one."""


def clusters(scan: LaserScan, pose: Array, robot: float, largest: float = LARGEST) -> Array:
    """Circles (N, 3) of what stands free: nothing nearer hides its left or its right side.

    Beams that tell nothing are left out. What is seen of a wall past a nearer thing moves with the
    robot, and is no cluster.

    Parameters
    ----------
    scan : LaserScan
        Seen from the pose.
    pose : ndarray
        Of the robot (3,).
    robot : float
        Its radius [m].
    largest : float
        Largest radius of a cluster [radii].

    Returns
    -------
    ndarray
        (N, 3) rows x, y, radius [m] in the frame of the pose.
    """
    told = np.flatnonzero(scan.hits | scan.clear)
    count, gap, largest = len(told), GAP * robot, largest * robot
    if count < FEWEST + 2:
        return np.empty((0, 3))
    # from each to the next one, and from the last to the first
    following = np.concatenate([told[1:], told[:1]])
    step = scan.ends.take(following, axis=0) - scan.ends.take(told, axis=0)
    together = scan.hits.take(told) & scan.hits.take(following)
    together &= np.hypot(step[:, 0], step[:, 1]) <= gap
    # a cluster lies between two gaps of the ring; the one behind the first gap comes first
    gaps = np.flatnonzero(~together)
    begins, ends = (gaps + 1) % count, np.concatenate([gaps[1:], gaps[:1]])
    chosen = scan.hits.take(told.take(begins)) & ((ends - begins) % count + 1 >= FEWEST)
    chosen &= _extents(scan.ends.take(told, axis=0), gaps) <= 2.0 * largest
    begins, ends = begins[chosen], ends[chosen]
    left, right = told.take(begins - 1), told.take((ends + 1) % count)
    return _circles(scan, pose, gap, largest, (left, told.take(begins), told.take(ends), right))


def _extents(ring: Array, gaps: NDArray[np.intp]) -> Array:
    """Longest sides (G,) of the boxes around the runs that begin behind each gap of a ring (n, 2).

    Both walls of a corridor are one run that leads around the robot: its ends lie near each other.
    """
    if not len(gaps):
        return np.empty(0)
    ring = np.roll(ring, -1 - gaps[0], axis=0)
    begins = gaps - gaps[0]
    sides = np.maximum.reduceat(ring, begins) - np.minimum.reduceat(ring, begins)
    longest: Array = sides.max(axis=1)
    return longest


def _circles(
    scan: LaserScan, pose: Array, gap: float, largest: float, beams: tuple[Array, ...]
) -> Array:
    """Circles (N, 3) of runs of hits, of those that stand free.

    Each run has four beams (K,): before it, the first, the last, and behind it.
    """
    before, first, last, behind = beams
    reach, ends = scan.reach, scan.ends
    # what ends at the scanner's reach goes on beyond it
    free = (reach[before] > reach[first] + gap) & (reach[behind] > reach[last] + gap)
    first, last = first[free], last[free]
    begin, end = ends[first], ends[last]
    width = abs(scan.angle_increment) * np.minimum(reach[first], reach[last])
    chords = np.hypot(*(end - begin).T)
    # the outermost beams that hit miss the sides by half a step each
    radii = 0.5 * (chords + width)
    small = radii <= largest
    radii, chords = radii[small], chords[small]
    middle = 0.5 * (begin + end)[small] - scan.mount[:2]
    # the chord lies before the centre
    beyond = np.sqrt(radii**2 - 0.25 * chords**2)
    middle *= (1.0 + beyond / np.maximum(np.hypot(*middle.T), radii))[:, None]
    x, y = rotate(middle[:, 0] + scan.mount[0], middle[:, 1] + scan.mount[1], float(pose[2]))
    return np.column_stack([x + pose[0], y + pose[1], radii])
