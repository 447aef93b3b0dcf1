"""LDROBOT LD06 and LD19: they turn and send as soon as they have power.

Bytes and packets as in their development manuals, v2.3 and v1.0. A packet has 47 bytes: 0x54, 0x2C
(version and 12 points), speed [deg/s], angle of the first point [0.01 deg], 12 times distance [mm]
and intensity, angle of the last point, time [ms, up to 30000], CRC; little-endian. Angles grow
clockwise, seen from above.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from firmware_bridge.link import Transport
from firmware_bridge.link.framing import Packets
from firmware_bridge.sensors.lidar.lidar import SerialLidar, Turns

HEADER = b"\x54\x2c"
POINTS = 12
SIZE = 47
PACKET = struct.Struct("<2sHH36sHHB")
POINT = struct.Struct("<HB")
POLYNOMIAL = 0x4D
CIRCLE = 36000  # a turn in hundredths of a degree
BAUD = 230400
RANGE_MIN, RANGE_MAX = 0.02, 12.0  # [m]
RADIANS = math.tau / CIRCLE
SLOWEST = 360  # a motor that makes less than a turn a second is stuck, or has no power [deg/s]


def _table() -> bytes:
    table = bytearray()
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ POLYNOMIAL if byte & 0x80 else byte << 1
        table.append(byte & 0xFF)
    return bytes(table)


CRC_TABLE = _table()


def crc8(data: bytes) -> int:
    """CRC-8, polynomial 0x4D, start 0.

    Examples
    --------
    >>> crc8(bytes([1, 2, 3]))
    108
    """
    crc = 0
    for byte in data:
        crc = CRC_TABLE[crc ^ byte]
    return crc


@dataclass(frozen=True)
class Ld06Packet:
    """Twelve points."""

    speed: int  # [deg/s]
    start: int  # angle of the first point, clockwise [0.01 deg]
    points: tuple[tuple[int, int], ...]  # distance [mm], 0 for none, and intensity of each
    end: int  # angle of the last point [0.01 deg]
    time: int  # [ms], which wraps at 30000

    @property
    def angles(self) -> list[float]:
        """Clockwise angle of each point [0.01 deg], which may pass a whole turn."""
        step = (self.end - self.start) % CIRCLE / (POINTS - 1)
        return [self.start + i * step for i in range(POINTS)]

    def to_bytes(self) -> bytes:
        """Build the packet.

        >>> Ld06Packet(3600, 0, ((1000, 200),) * 12, 960, 5).to_bytes()[:6].hex(" ")
        '54 2c 10 0e 00 00'
        """
        points = b"".join(POINT.pack(*point) for point in self.points)
        body = PACKET.pack(HEADER, self.speed, self.start, points, self.end, self.time, 0)[:-1]
        return body + bytes((crc8(body),))


class Ld06Packets(Packets[Ld06Packet]):
    """Packets out of bytes: what has a wrong CRC, or stands between packets, is skipped."""

    def __init__(self) -> None:
        super().__init__()
        self.bad_crc = 0  # packets whose CRC is wrong
        self.packets = 0

    def _cut(self, buffer: bytearray, at: int) -> tuple[int, Ld06Packet | None] | None:
        if (start := buffer.find(HEADER, at)) != at:
            end = start if start > 0 else len(buffer) - buffer.endswith(HEADER[:1])
            return (end - at, None) if end > at else None
        frame = bytes(buffer[at : at + SIZE])
        if len(frame) < SIZE:
            return None
        if crc8(frame[:-1]) != frame[-1]:
            self.bad_crc += 1
            return 1, None
        self.packets += 1
        _, speed, first, points, last, time, _ = PACKET.unpack(frame)
        return SIZE, Ld06Packet(speed, first, tuple(POINT.iter_unpack(points)), last, time)


class Ld06(SerialLidar):
    """Twelve points a packet, ten turns a second; nothing is sent to the sensor.

    `transport`: not yet started.
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
