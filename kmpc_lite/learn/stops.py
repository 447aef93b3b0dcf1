"""Where a robot is told to stop from speed: what shows how far it goes on then."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.types import Array

STANDING = 0.1
"""Share of the largest speed below which a robot counts as told to stand, and of the largest turn
rate below which it counts as told to drive straight on."""
FAST = 0.5
"""Share of the largest speed from which a stop begins, at least."""
REST = 0.5
"""How long the robot is told to stand, at least [s]."""
FALLS = 0.005
"""Share of the largest speed by which a command falls from one row to the next, at least."""


class Stop(NamedTuple):
    """Rows of one stop."""

    begin: int
    """First row whose command is slower than the one before."""
    rest: int
    """First row that tells the robot to stand."""
    end: int
    """First row that tells it to move again, or the number of rows."""


def find_stops(speeds: Array, dt: float, largest: float) -> list[Stop]:
    """Find the stops from speed in one stretch of commands.

    Parameters
    ----------
    speeds : ndarray
        Commanded speeds, one a period, (T,) [m/s or rad/s].
    dt : float
        Period [s].
    largest : float
        Largest speed of the robot, of the same unit.
    """
    size = np.abs(speeds)
    still = np.concatenate([[False], size <= STANDING * largest, [False]])
    begins = np.flatnonzero(~still[:-1] & still[1:])
    ends = np.flatnonzero(still[:-1] & ~still[1:])
    # where the command has fallen from one row to the next, without changing its sign
    falls = (np.diff(size) < -FALLS * largest) & (speeds[1:] * speeds[:-1] >= 0.0)
    found = []
    for rest, end in zip(begins, ends, strict=True):
        begin = rest
        while begin > 0 and falls[begin - 1]:
            begin -= 1
        rests = (end - rest) * dt >= REST - 1e-9
        if rests and begin < rest and size[begin] >= FAST * largest:
            found.append(Stop(int(begin) + 1, int(rest), int(end)))
    return found
