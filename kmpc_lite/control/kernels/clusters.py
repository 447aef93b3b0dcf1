"""Small things that stand free in a scan, as circles: legs, people, posts.

Sizes: B beams, at most 16,384; K clusters, at most B / 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.types import Array

FEWEST = 3
"""Hits of the smallest cluster."""


def clusters(
    reach: Array,
    ends: Array,
    hits: NDArray[np.bool_],
    clear: NDArray[np.bool_],
    mount: Array,
    step: float,
    gap: float,
    largest: float,
) -> Array:
    """Circles (K, 3) of what stands free: nothing nearer hides its left or its right side.

    Beams that tell nothing are left out. What is seen of a wall past a nearer thing moves with the
    robot, and is no cluster.

    Parameters
    ----------
    reach : ndarray
        (B,) how far each beam saw nothing [m].
    ends : ndarray
        (B, 2) where it ends in the robot's frame [m].
    hits, clear : ndarray
        (B,) whether it hit something, and whether it saw that nothing is there.
    mount : ndarray
        (2,) the scanner in the robot's frame [m].
    step : float
        Angle from beam to beam [rad].
    gap : float
        Distance between neighbouring hits beyond which another cluster begins [m].
    largest : float
        Largest radius of a cluster [m].

    Returns
    -------
    ndarray
        (K, 3) rows x, y, radius [m] in the robot's frame.
    """
    told = np.flatnonzero(hits | clear)
    count = len(told)
    if count < FEWEST + 2:
        return np.empty((0, 3))
    ring, hit, far = ends.take(told, axis=0), hits.take(told), reach.take(told)
    # from each to the next one, and from the last to the first
    following = np.roll(np.arange(count), -1)
    away = ring.take(following, axis=0) - ring
    together = hit & hit.take(following)
    together &= np.hypot(away[:, 0], away[:, 1]) <= gap
    # a cluster lies between two gaps of the ring; the one behind the first gap comes first
    gaps = np.flatnonzero(~together)
    begins, last = (gaps + 1) % count, np.concatenate([gaps[1:], gaps[:1]])
    chosen = hit.take(begins) & ((last - begins) % count + 1 >= FEWEST)
    chosen &= _extents(ring, gaps) <= 2.0 * largest
    first, last = begins[chosen], last[chosen]
    # what ends at the scanner's reach goes on beyond it
    free = far.take(first - 1) > far.take(first) + gap
    free &= far.take((last + 1) % count) > far.take(last) + gap
    first, last = first[free], last[free]
    begin, end = ring.take(first, axis=0), ring.take(last, axis=0)
    # the outermost beams that hit miss the sides by half a step each
    chords = np.hypot(end[:, 0] - begin[:, 0], end[:, 1] - begin[:, 1])
    radii = 0.5 * (chords + step * np.minimum(far.take(first), far.take(last)))
    small = radii <= largest
    radii, chords = radii[small], chords[small]
    middle = 0.5 * (begin + end)[small] - mount
    # the chord lies before the centre
    beyond = np.sqrt(np.maximum(radii**2 - 0.25 * chords**2, 0.0))
    beyond /= np.maximum(np.hypot(middle[:, 0], middle[:, 1]), radii)
    return np.column_stack([middle * (1.0 + beyond)[:, None] + mount, radii])


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
