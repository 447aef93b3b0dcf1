"""An LD06 or LD19: packets of twelve points, from the moment it has power."""

from __future__ import annotations

from collections import deque

from firmware_bridge.sensors.lidar.ld06 import CIRCLE, POINTS, Ld06Packet
from kmpc_lab.emulator.lidar.lidar import LidarEmulator, LidarModel
from kmpc_lite.types import Array

MODEL = LidarModel(rate=10.0, beams=450, reach=12.0)
INTENSITY = 200
WRAP = 30000
"""Of the time stamp [ms]."""


class Ld06Emulator(LidarEmulator):
    """See `LidarEmulator`."""

    _waiting: deque[tuple[int, int]]
    """Angle [0.01 deg] and distance [mm] of points that fill no packet yet."""

    def _bytes(self, number: int, ranges: Array, now: float) -> bytes:
        waiting = self.__dict__.setdefault("_waiting", deque())
        stuck = self.faults.stuck
        for i, distance in enumerate(ranges):
            angle = float(self.angles(number + (0 if stuck else i)))
            hundredths = round(angle * CIRCLE / 6.283185307179586) % CIRCLE
            waiting.append((hundredths, round(1e3 * distance) if distance < 65.0 else 0))
        sent = b""
        speed = 0 if stuck else round(360.0 * self.model.rate)
        while len(waiting) >= POINTS:
            points = [waiting.popleft() for _ in range(POINTS)]
            packet = Ld06Packet(
                speed,
                points[0][0],
                tuple((max(0, mm), INTENSITY) for _, mm in points),
                points[-1][0],
                round(1e3 * now) % WRAP,
            )
            sent += packet.to_bytes()
        return sent
