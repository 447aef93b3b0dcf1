"""LDROBOT LD06 and LD19: they turn and send as soon as they have power."""

from __future__ import annotations

import math

from firmware_bridge.link import Transport
from firmware_bridge.sensors.lidar.ld06_frames import CIRCLE, Ld06Packets
from firmware_bridge.sensors.lidar.lidar import SerialLidar
from firmware_bridge.sensors.lidar.turns import Turns

BAUD = 230400
RANGE_MIN, RANGE_MAX = 0.02, 12.0
"""[m]"""
RADIANS = math.tau / CIRCLE
SLOWEST = 360
"""A motor that makes less than a turn a second is stuck, or has no power [deg/s]."""


class Ld06(SerialLidar):
    """Twelve points a packet, ten turns a second; nothing is sent to the sensor.

    Parameters
    ----------
    transport : Transport
        Not yet started.
    """

    name = "LD06/LD19"
    bauds = f"{BAUD}"

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport, Turns(RANGE_MIN, RANGE_MAX))
        self._packets = Ld06Packets()
        self._speed = CIRCLE

    def _take(self, data: bytes, stamp: float) -> bool:
        packets = self._packets.feed(data)
        for packet in packets:
            self._speed = packet.speed
            angles = [angle % CIRCLE * RADIANS for angle in packet.angles]
            ranges = [1e-3 * mm if mm else math.nan for mm, _ in packet.points]
            self._turns.add(angles, ranges, stamp)
        return bool(packets)

    def _troubles(self, now: float) -> tuple[str, ...]:
        if self._speed >= SLOWEST:
            return ()
        return (
            f"lidar: its motor makes {self._speed} degrees a second: stuck, or too little power",
        )

    def _counts(self) -> dict[str, int]:
        return {
            "packets": self._packets.packets,
            "bad_bytes": self._packets.bad,
            "bad_crc": self._packets.bad_crc,
        }
