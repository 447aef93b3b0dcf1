"""Small things that stand free in a scan, as circles: legs, people, posts."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.obstacles.scan import LaserScan
from kmpc_lite.geometry import rotate
from kmpc_lite.types import Array


def clusters(scan: LaserScan, pose: Array, gap: float, largest: float, fewest: int) -> Array:
    """Circles (N, 3) of what stands free: nothing nearer hides its left or its right side.

    Beams that tell nothing are left out. What is seen of a wall past a nearer thing moves with the
    robot, and is no cluster.

    Parameters
    ----------
    scan : LaserScan
        Seen from the pose.
    pose : ndarray
        Of the robot (3,).
    gap : float
        Distance between neighbouring hits beyond which another cluster begins [m].
    largest : float
        Largest radius of a cluster [m].
    fewest : int
        Hits of the smallest one.

    Returns
    -------
    ndarray
        (N, 3) rows x, y, radius [m] in the frame of the pose.
    """
    told = np.flatnonzero(scan.hits | scan.clear)
    if len(told) < fewest + 2:
        return np.empty((0, 3))
    hits, reach, ends = scan.hits[told], scan.reach[told], scan.ends[told]
    # from each to the next one, and from the last to the first
    x, y = (np.diff(column, append=column[0]) for column in ends.T)
    apart = np.hypot(x, y) > gap
    apart |= ~hits
    apart[:-1] |= ~hits[1:]
    apart[-1] |= ~hits[0]
    if not apart.any():
        return np.empty((0, 3))
    # begin behind a gap, so that no cluster lies across the ends of the ring
    order = (np.arange(len(told)) + int(apart.argmax()) + 1) % len(told)
    hits, reach, ends, apart = hits[order], reach[order], ends[order], apart[order]
    last = np.flatnonzero(apart)
    first = np.concatenate([[0], last[:-1] + 1])
    left, right = reach[first - 1], reach[(last + 1) % len(reach)]
    # what ends at the scanner's reach goes on beyond it
    free = (left > reach[first] + gap) & (right > reach[last] + gap)
    step = abs(scan.angle_increment) * np.minimum(reach[first], reach[last])
    chords = np.hypot(*(ends[last] - ends[first]).T)
    # the outermost beams that hit miss the sides by half a step each
    radii = 0.5 * (chords + step)
    chosen = hits[first] & free & (last - first + 1 >= fewest) & (radii <= largest)
    radii, chords = radii[chosen], chords[chosen]
    middle = 0.5 * (ends[first] + ends[last])[chosen] - scan.mount[:2]
    # the chord lies before the centre
    behind = np.sqrt(radii**2 - 0.25 * chords**2)
    middle *= (1.0 + behind / np.maximum(np.hypot(*middle.T), radii))[:, None]
    x, y = rotate(middle[:, 0] + scan.mount[0], middle[:, 1] + scan.mount[1], float(pose[2]))
    return np.column_stack([x + pose[0], y + pose[1], radii])
