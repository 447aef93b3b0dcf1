"""Where the robot was of late, and where it is by now."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from firmware_bridge.messages import State
from firmware_bridge.sensors.scan import Array

KEPT = 256
"""Number of poses that are remembered: two seconds of a fast source."""
AHEAD = 0.3
"""A pose is carried on with its own speeds for so long at the most [s]."""


class Trail:
    """Remembers poses and tells those between and shortly behind them.

    One thread adds while others ask.
    """

    def __init__(self) -> None:
        self._states: deque[State] = deque(maxlen=KEPT)

    def add(self, state: State | None) -> None:
        """Remember a pose, if it is finite and newer than the last."""
        if state is None or not all(map(math.isfinite, (state.x, state.y, state.theta))):
            return
        if not self._states or state.stamp > self._states[-1].stamp:
            self._states.append(state)

    def poses(self, stamps: Array) -> Array | None:
        """Poses x, y [m], theta [rad] at times (N,) [s], (N, 3); None where none is remembered.

        Between poses they are interpolated. After the last they go on with its speeds, straight
        and turning evenly, for `AHEAD` at the most; before the first they are the first.
        """
        states = tuple(self._states)
        if not states:
            return None
        times = np.array([s.stamp for s in states])
        path = np.array([(s.x, s.y, s.theta) for s in states])
        path[:, 2] = np.unwrap(path[:, 2])
        found = np.column_stack([np.interp(stamps, times, column) for column in path.T])
        last = states[-1]
        later = np.clip(stamps - last.stamp, 0.0, AHEAD)
        if np.isfinite((last.v, last.omega)).all():
            heading = last.theta + 0.5 * later * last.omega
            found[:, 0] += later * last.v * np.cos(heading)
            found[:, 1] += later * last.v * np.sin(heading)
            found[:, 2] += later * last.omega
        return found
