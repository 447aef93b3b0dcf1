"""What a board's clock is at, from what it says."""

from __future__ import annotations

import math
from collections import deque

WAYS = 50
"""Telemetry by which a board's clock is known: of five seconds."""


class BoardClock:
    """What a board's clock is at: from its telemetry, of which the fastest came at once.

    A board that is thought to be behind takes what it is sent for older than it is: it stops
    rather too early.
    """

    def __init__(self) -> None:
        self._ways: deque[float] = deque(maxlen=WAYS)
        self._newest = -math.inf

    @property
    def known(self) -> bool:
        """Whether it has been heard."""
        return bool(self._ways)

    def hear(self, uptime: float, stamp: float) -> None:
        """Take its clock [s], heard at `stamp` [s]."""
        if uptime < self._newest:  # it was switched off and on
            self._ways.clear()
        self._newest = uptime
        self._ways.append(stamp - uptime)

    def at(self, stamp: float) -> float:
        """Its clock [s] at a time of ours [s]."""
        return stamp - min(self._ways)
