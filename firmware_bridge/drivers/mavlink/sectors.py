"""Distances around the vehicle: OBSTACLE_DISTANCE and DISTANCE_SENSOR, as turns of a lidar."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from firmware_bridge.messages import State
from firmware_bridge.sensors.lidar.lidar import LidarHealth
from firmware_bridge.sensors.scan import Array, Sweep

OBSTACLE_DISTANCE, DISTANCE_SENSOR = "OBSTACLE_DISTANCE", "DISTANCE_SENSOR"
UNKNOWN = 65535
"""Distance of a sector of which nothing is known."""
NORTH_ALIGNED, BODY = frozenset((0, 1)), frozenset((8, 12))
"""MAV_FRAMEs of OBSTACLE_DISTANCE: GLOBAL and LOCAL_NED; BODY_NED and BODY_FRD."""
EIGHTH = math.tau / 8.0
"""Between two orientations of DISTANCE_SENSOR, of which the first eight lie in the plane [rad]."""
PROXIMITY_ID = 10
"""ArduPilot tells the sectors of its proximity sensors as distance sensors from this id on: each is
an eighth of a turn. Other sensors are as wide as they say."""
NARROW = math.radians(10.0)
"""Width of a sensor that does not say how wide it is [rad]."""
INVALID = 1
"""DISTANCE_SENSOR.signal_quality of a reading that is none."""
KEPT = 1.0
"""Age from which a sector is unknown [s]."""
FINE = math.radians(1.0)
"""Sectors are divided into beams no wider than this [rad]."""


class Sectors:
    """What the vehicle tells of its surroundings; a `Lidar` without a link of its own.

    A sector says how near the nearest thing in it is: all its beams get that distance.

    Parameters
    ----------
    system : int
        Id of the vehicle; any of its components may tell.
    pose : callable
        Newest state in the vehicle's own frame: some sectors are aligned with north.
    """

    def __init__(self, system: int, pose: Callable[[], State | None]) -> None:
        self._system, self._pose = system, pose
        self._newest: Sweep | None = None
        self._kind, self._kind_stamp = "", -math.inf
        self._eighths: dict[int, tuple[float, float, float]] = {}
        """By orientation: stamp [s], distance [m], width [rad]."""
        self._stamps: deque[float] = deque(maxlen=32)
        self.counters = dict.fromkeys(("messages", "refused"), 0)

    def take(self, message: Any, now: float) -> None:
        """Take a message that came at `now` [s], if it is one of the two kinds, of the vehicle."""
        kind = message.get_type()
        if message.get_srcSystem() != self._system:
            return
        if kind == OBSTACLE_DISTANCE:
            made = self._ring(message, now)
        elif kind == DISTANCE_SENSOR:
            if self._kind == OBSTACLE_DISTANCE and now - self._kind_stamp < KEPT:
                return  # the same again, and coarser
            made = self._single(message, now)
        else:
            return
        self.counters["messages"] += 1
        if made is None:
            self.counters["refused"] += 1
            return
        self._newest, self._kind, self._kind_stamp = made, kind, now
        self._stamps.append(now)

    def connect(self, timeout: float) -> None:
        """Do nothing: the vehicle's link is opened by its driver, and the gate waits for scans."""

    def sweep(self) -> Sweep | None:
        """Newest distances all around."""
        return self._newest

    def health(self) -> LidarHealth:
        """What is known of the sensors."""
        now, stamps = time.monotonic(), tuple(self._stamps)
        if not stamps or now - stamps[-1] > KEPT:
            fault = (
                f"lidar: no {OBSTACLE_DISTANCE} or {DISTANCE_SENSOR} for {KEPT:g} s: "
                "is the vehicle's proximity sensor set up (PRX1_TYPE)?"
            )
            return LidarHealth(True, "autopilot's sectors", 0.0, (fault,), dict(self.counters))
        span = stamps[-1] - stamps[0]
        rate = (len(stamps) - 1) / span if span > 0.0 else 0.0
        return LidarHealth(True, self._kind, rate, (), dict(self.counters))

    def close(self) -> None:
        """Do nothing: the driver closes its link."""

    def _ring(self, m: Any, now: float) -> Sweep | None:
        """OBSTACLE_DISTANCE: up to 72 sectors, clockwise from the front or from north."""
        step = math.radians(m.increment_f if m.increment_f else m.increment)
        limits = 1e-2 * m.min_distance, 1e-2 * m.max_distance
        first = math.radians(m.angle_offset)
        if not (math.isfinite(step) and math.isfinite(first)) or limits[0] >= limits[1]:
            return None
        if not math.radians(0.1) <= abs(step) <= EIGHTH:
            return None
        if m.frame in NORTH_ALIGNED:
            state = self._pose()
            if state is None or not math.isfinite(state.theta):
                return None
            # a bearing from north, as seen from the vehicle: less its own
            first -= math.pi / 2.0 - state.theta
        elif m.frame not in BODY:
            return None
        count = min(len(m.distances), math.floor(math.tau / abs(step) + 1e-6))
        raw = np.array(m.distances[:count], dtype=float)
        ranges = np.where(raw == UNKNOWN, np.nan, np.where(raw > m.max_distance, np.inf, raw / 100))
        angles = -(first + step * np.arange(count))
        return _spread(angles, ranges, np.full(count, abs(step)), np.full(count, now), limits)

    def _single(self, m: Any, now: float) -> Sweep | None:
        """DISTANCE_SENSOR: one sector, beside those of the other orientations."""
        limits = 1e-2 * m.min_distance, 1e-2 * m.max_distance
        if m.orientation >= 8 or limits[0] >= limits[1]:
            return None
        width = EIGHTH if m.id >= PROXIMITY_ID else NARROW
        if math.isfinite(m.horizontal_fov) and m.horizontal_fov > 0.0:
            width = min(m.horizontal_fov, EIGHTH)
        reading = math.inf if m.current_distance >= m.max_distance else 1e-2 * m.current_distance
        reading = math.nan if m.signal_quality == INVALID else reading
        self._eighths[m.orientation] = (now, reading, width)
        known = {k: v for k, v in self._eighths.items() if now - v[0] <= KEPT}
        stamps, ranges, widths = (np.array(column) for column in zip(*known.values(), strict=True))
        angles = -EIGHTH * np.array(tuple(known))
        return _spread(angles, ranges, widths, stamps, limits)


def _spread(
    angles: Array, ranges: Array, widths: Array, stamps: Array, limits: tuple[float, float]
) -> Sweep:
    """Divide sectors (N,) into fine beams."""
    copies = np.ceil(widths / FINE - 1e-6).astype(int)
    of = np.repeat(np.arange(len(angles)), copies)
    number = np.arange(len(of)) - np.repeat(np.cumsum(copies) - copies, copies)
    offsets = ((number + 0.5) / copies[of] - 0.5) * widths[of]
    return Sweep(angles[of] + offsets, ranges[of], stamps[of], *limits)
