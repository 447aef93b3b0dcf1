"""Beams as they arrive, made whole turns: where one ends, and when each beam was measured."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from statistics import median

import numpy as np

from firmware_bridge.sensors.scan import Sweep

LONGEST = 8192
"""A turn of more beams is none: a sensor whose angle does not advance, or a flood."""
FEWEST = 24
"""A turn of fewer beams is none."""
PARTS = 36
"""Equal parts of a turn, of which at least half must hold a beam: a motor that is stuck, or
jitters, makes no turn."""
SLOWEST, FASTEST = 1.0, 0.02
"""How long a turn may take, and must [s]."""
RECENT = 9
"""Number of recent turns from which the time of the next is estimated."""
RATE_AGE = 2.0
"""A sensor whose last turn is older turns no more [s]."""


class Turns:
    """Collects beams of a sensor that turns clockwise.

    A beam is stamped by its angle: the turn lasts from the arrival of its first beam to that of
    the next turn's first one, so that neither the size of packets nor that of reads matters. The
    first turn, whose beginning is unknown, does not count.

    `range_min`, `range_max`: of the sensor [m].
    """

    def __init__(self, range_min: float, range_max: float) -> None:
        self._limits = range_min, range_max
        self._angles: list[float] = []
        self._ranges: list[float] = []
        self._began, self._last = -math.inf, 0.0
        self._times: deque[float] = deque(maxlen=RECENT)
        self.newest: Sweep | None = None
        self.counters = dict.fromkeys(("turns", "broken_turns"), 0)

    def add(self, angles: Iterable[float], ranges: Iterable[float], stamp: float) -> None:
        """Take beams that came at `stamp` [s]: clockwise angles, 0 to a turn [rad], and [m] or NaN.

        Where the angle falls by more than half a turn, another turn begins: a bit that says so
        may be lost.
        """
        if len(self._angles) >= LONGEST:
            self.counters["broken_turns"] += 1
            self.drop()
        for angle, distance in zip(angles, ranges, strict=True):
            if self._last - angle > math.pi:
                self._end(stamp)
            self._last = angle
            self._angles.append(angle)
            self._ranges.append(distance)

    def _end(self, stamp: float) -> None:
        """End the turn: the next beam is the first of another."""
        began, self._began = self._began, stamp
        angles, self._angles = np.array(self._angles), []
        ranges, self._ranges = np.array(self._ranges), []
        took = stamp - began
        if not _whole(angles) or not FASTEST <= took <= SLOWEST:
            self.counters["broken_turns"] += math.isfinite(took)
            return
        self._times.append(took)
        # a read that came late must not stretch the turn
        usual = median(self._times)
        took = min(max(took, 0.5 * usual), 1.5 * usual)
        swept = np.unwrap(angles) - angles[0]
        stamps = stamp - took * (1.0 - np.clip(swept / math.tau, 0.0, 1.0))
        self.newest = Sweep(-angles, ranges, stamps, *self._limits)
        self.counters["turns"] += 1

    def drop(self) -> None:
        """Forget the turn under way."""
        self._angles, self._ranges, self._began, self._last = [], [], -math.inf, 0.0

    def rate(self, now: float) -> float:
        """Turns per second [Hz]; 0 if it does not turn."""
        times = tuple(self._times)  # another thread adds
        if not times or self.newest is None or now - self.newest.stamp > RATE_AGE:
            return 0.0
        return 1.0 / median(times)


def _whole(angles: np.ndarray) -> bool:
    """Whether beams (N,) [rad] cover enough of a turn."""
    if len(angles) < FEWEST:
        return False
    parts = np.floor(np.mod(angles, math.tau) / math.tau * PARTS).astype(int)
    return len(np.unique(parts)) >= PARTS // 2
