"""What a lidar saw: one turn as measured, and the same as a controller takes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
