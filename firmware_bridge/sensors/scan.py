"""What a lidar saw: one turn as measured, as a controller takes it, and whether it is news."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmware_bridge.messages import State

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Sweep:
    """One turn of a sensor as it was measured: each beam from where the sensor was at its time."""

    angles: Array
    """Directions of the beams in the order in which they were measured, counter-clockwise from the
    sensor's front (N,) [rad]."""
    ranges: Array
    """Distances (N,) [m]; inf: nothing within reach; NaN: nothing is known."""
    stamps: Array
    """`time.monotonic()` of each beam (N,) [s]."""
    range_min: float
    """[m]"""
    range_max: float
    """[m]"""

    @property
    def stamp(self) -> float:
        """When its newest beam was measured [s]."""
        return float(self.stamps.max())

    @property
    def returns(self) -> float:
        """Share of the beams that say something, 0 to 1."""
        return float((~np.isnan(self.ranges)).mean())


@dataclass(frozen=True, eq=False)
class Scan:
    """One turn as if it were measured at once, its beams equally far apart."""

    ranges: Array
    """Distances (N,) [m]; inf: nothing within reach; NaN: nothing is known."""
    angle_min: float
    """Direction of the first beam, counter-clockwise from the sensor's front [rad]."""
    angle_increment: float
    """Between two beams [rad]."""
    range_min: float
    """[m]"""
    range_max: float
    """[m]"""
    mount: tuple[float, float, float]
    """Pose of the sensor when it measured, as seen from the pose for which the scan was asked for
    [m, m, rad]."""
    stamp: float
    """When its newest beam was measured [s]."""
    noise: float = 0.01
    """Standard deviation of a distance [m]."""

    @property
    def angles(self) -> Array:
        """Directions of the beams (N,) [rad]."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))


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
