"""Where a search begins, what it goes around, and the clearances that it tries.

A round robot deep in an obstacle's margin is led straight out first. A search takes the obstacle
for as small as lets the robot be outside; deep in the margin its path would lead along the
obstacle, where hardly any motion is safe.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.planner import ROUNDING, Path, PathRequest
from kmpc_lite.control.path.turning_centre import swing
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

DEEP = 0.015
"""A robot that is so deep in a margin is led out first [m] ..."""
OUTSIDE = 0.03
"""... to where it keeps so much more than the margin [m]: there it turns."""
OUTWARDS = 64
"""Directions in which a way out is looked for ..."""
FARTHER = np.array([1.0, 1.25, 1.5, 1.75])
"""... and lengths, as multiples of what is missing."""
OUTWARD_SHARE = 0.55
"""Least share of the way that leads away from what is near: a motion that leads away by less than
half of it is not safe."""
LEAST_CLEARANCE = 0.005
"""Clearance that is tried last: a path that keeps less would not be driven [m]."""


def way_out(request: PathRequest) -> Array | None:
    """Pose (3,) to which a round robot deep in a margin drives first; None if it is not.

    It lies straight ahead or behind once the robot has turned.
    """
    start, needed = request.start, request.inflation + OUTSIDE
    around = float(request.distances(start[None, :2])[0])
    if request.inflation - around <= DEEP:
        return None
    courses = start[2] + math.tau / OUTWARDS * np.arange(OUTWARDS)
    lengths = (FARTHER * (needed - around))[:, None]
    away = lengths[..., None] * np.stack([np.cos(courses), np.sin(courses)], axis=1)
    ends, middles = start[:2] + away, start[:2] + 0.5 * away
    clear = ((ends >= request.area[0]) & (ends <= request.area[1])).all(axis=2)
    shape = clear.shape
    reached = request.distances(ends.reshape(-1, 2)).reshape(shape)
    between = request.distances(middles.reshape(-1, 2)).reshape(shape)
    clear &= (reached >= needed - ROUNDING) & (reached >= around + OUTWARD_SHARE * lengths)
    clear &= between > around
    if not clear.any():
        return None
    ahead = np.abs(wrap(courses - start[2]))
    behind = np.full(len(ahead), np.inf)
    if request.backward[0] > 0.0:
        behind = math.pi - ahead
    times = np.minimum(ahead, behind) / request.forward[1] + lengths / request.forward[0]
    length, best = divmod(int(np.where(clear, times, np.inf).argmin()), OUTWARDS)
    turned = math.pi if behind[best] < ahead[best] else 0.0
    return np.array([*ends[length, best], courses[best] + turned])


def led_out(path: Path, start: Array) -> Path:
    """Give a path that begins at a way out, from a pose (3,) of the robot on."""
    poses = path.poses.copy()
    poses[:, 2] += start[2] + wrap(float(poses[0, 2] - start[2])) - poses[0, 2]
    turned = np.array([start[0], start[1], poses[0, 2]])
    return replace(path, poses=np.concatenate([start[None], turned[None], poses]))


def all_clearances(request: PathRequest, turning: float, options: GuidanceOptions) -> list[float]:
    """Clearances that are tried [m], the widest first.

    `request`: has the clearance at full speed, and the turning centre. `turning`: what the robot
    needs beyond half its width to turn on the spot [m]; a round one nothing. `options`: in metres.
    """
    widest, centre = options.wide_clearance, request.centre
    narrow = [options.narrow_clearance, LEAST_CLEARANCE]
    clearances = [widest, *narrow]
    if request.clearance > widest:
        clearances = [request.clearance, *clearances]
    beside = 0.0 if centre is None else abs(float(centre[1]))
    if turning:
        # first where it may turn anywhere, then where it just fits through
        wider = [c + turning + swing(centre) for c in clearances]
        return wider + [c + beside for c in (widest, *narrow)]
    if centre is None:
        return clearances
    # the pose swings around the turning centre: where that is too wide, only as far as it lies
    # beside it
    around = swing(centre)
    return [c + around for c in clearances] + [c + beside for c in narrow]
