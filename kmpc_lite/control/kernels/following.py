"""Where on a timed path a robot is, and the reference that it follows from there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import STATES, Array


class Timed(NamedTuple):
    """Poses along a path, at the times at which they can be reached."""

    poses: Array
    """(K, 3) from the turn at the start to the one at the goal, K > 1."""
    times: Array
    """(K,) from zero on, growing [s]; the last turn begins at the last but one."""
    cusps: Array
    """(n,) when the robot stops and drives on in the other gear [s]."""
    step: float
    """Time between poses among which the robot's place is looked for [s]."""
    braking: float
    """How long the robot brakes at the end of a leg [s]."""


def poses_at(path: Timed, times: Array) -> Array:
    """Poses (n, 3) at times (n,) [s]; the ends are held."""
    poses = np.empty((len(times), STATES))
    # as complex numbers, for both coordinates are interpolated in the time of one
    places = np.interp(times, path.times, path.poses[:, 0] + 1j * path.poses[:, 1])
    poses[:, :2] = places.view(float).reshape(-1, 2)
    poses[:, 2] = np.interp(times, path.times, path.poses[:, 2])
    return poses


def leg_end(path: Timed, begin: float) -> float:
    """When the gear changes next after a time [s]; infinite if it does not."""
    later = path.cusps[path.cusps > begin]
    return float(later[0]) if len(later) else math.inf
