"""Tells of a lidar whose turns repeat each other although the robot moves: they are no news."""

from __future__ import annotations

import math

import numpy as np

from firmware_bridge.messages import State
from firmware_bridge.sensors.scan import Sweep

TRAVEL, TURN = 0.1, 0.1
"""A robot that has come so far [m], or turned so far [rad], sees something else."""
DISTINCT = 12
"""Turns of fewer different distances may well be the same again: a few coarse sectors, a field."""


class FrozenScan:
    """Compares each turn with the first that was like it, and where the robot was then."""

    def __init__(self) -> None:
        self._first: Sweep | None = None
        self._there: State | None = None

    def repeats(self, sweep: Sweep, state: State | None) -> bool:
        """Whether a new turn is the same, to the last digit, as one seen from elsewhere."""
        first, there = self._first, self._there
        if first is None or not _same(first, sweep):
            self._first, self._there = sweep, state
            return False
        if there is None or state is None:
            self._there = state
            return False
        turned = abs(math.remainder(state.theta - there.theta, math.tau))
        moved = math.hypot(state.x - there.x, state.y - there.y)
        return moved > TRAVEL or turned > TURN


def _same(first: Sweep, second: Sweep) -> bool:
    if not np.array_equal(first.ranges, second.ranges, equal_nan=True):
        return False
    return len(np.unique(second.ranges[np.isfinite(second.ranges)])) >= DISTINCT
