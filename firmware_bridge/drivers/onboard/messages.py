"""Messages of a board that plans by itself: the twin of `messages.h` and `host.c` of an export."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from firmware_bridge.link.framing import CobsFrames, cobs_frame

VERSION = 1
PAYLOAD = 1024
"""Bytes at most."""
LONGEST = PAYLOAD + 12
"""Of a whole frame [bytes]."""


class Kind(IntEnum):
    """What a message is; the board's own are from 128 on."""

    HEARTBEAT = 1
    POSE = 2
    GOAL = 3
    OBSTACLES = 4
    PATH = 5
    MODEL = 6
    VELOCITY = 7
    ESTOP = 8
    RELEASE = 9
    ASK = 10
    ABOUT = 128
    STATE = 129
    WHEELS = 130


STANDING = (
    "",
    "no goal",
    "emergency stop",
    "host silent",
    "pose too old",
    "obstacles too old",
    "path too old",
)
"""Why it stands, or comes to rest; empty while it drives."""
STATUSES = ("SOLVED", "FEASIBLE", "FALLBACK", "STOPPED")
ESTOPPED = STANDING.index("emergency stop")
ABOUT = struct.Struct("<4B6f")
STATE = struct.Struct("<4I4BH5f")
NO_POSE = 0xFFFF
"""Age of a pose that was never said, or long ago [ms]."""


@dataclass(frozen=True)
class About:
    """The controller of a board."""

    horizon: int
    history: int
    """Past commands that its model depends on."""
    circles: int
    """At most."""
    poses: int
    """Of a path, at most."""
    dt: float
    """Period [s]."""
    radius: float
    """Of the robot [m]."""
    u_min: tuple[float, float]
    """[m/s, rad/s]"""
    u_max: tuple[float, float]


@dataclass(frozen=True)
class Telemetry:
    """What a board says of itself, ten times a second."""

    uptime: float
    """[s]"""
    heartbeat: int
    """The number of the newest heartbeat that it has heard."""
    good: int
    """Messages that it has understood."""
    bad: int
    """Frames that it has refused."""
    standing: str
    """Why it stands, in words; empty while it drives."""
    status: str
    """Of its plan."""
    passes: int
    poses: int
    """Of the path that it follows."""
    pose_age: float
    """[s]; infinite without any."""
    command: tuple[float, float]
    """[m/s, rad/s]"""
    pose: tuple[float, float, float]
    """The newest one that it was sent [m, m, rad]."""
    stamp: float
    """When it came, on our monotonic clock [s]."""


def message(kind: Kind, payload: bytes = b"") -> bytes:
    """Build a message as it goes over the wire.

    Examples
    --------
    >>> message(Kind.ESTOP).hex(" ")
    '05 01 08 b2 39 00'
    """
    if len(payload) > PAYLOAD:
        raise ValueError(f"payload: expected at most {PAYLOAD} bytes, got {len(payload)}")
    return cobs_frame(bytes((VERSION, kind)) + payload)


def floats(values: Iterable[float]) -> bytes:
    """Pack numbers as singles."""
    numbers = list(values)
    return struct.pack(f"<{len(numbers)}f", *numbers)


def heartbeat(number: int) -> bytes:
    """Say that the host is there."""
    return message(Kind.HEARTBEAT, struct.pack("<I", number & 0xFFFFFFFF))


def pose(x: float, y: float, theta: float, uptime: float) -> bytes:
    """Say where the robot was [m, m, rad] when its clock was at `uptime` [s]."""
    return message(Kind.POSE, floats((x, y, theta)) + _milliseconds(uptime))


def velocity(v: float, omega: float, uptime: float) -> bytes:
    """Say how fast to drive [m/s, rad/s]: asked when its clock was at `uptime` [s]."""
    return message(Kind.VELOCITY, floats((v, omega)) + _milliseconds(uptime))


def _milliseconds(uptime: float) -> bytes:
    return struct.pack("<I", round(1e3 * uptime) & 0xFFFFFFFF)


def rows(kind: Kind, table: Sequence[Sequence[float]]) -> bytes:
    """Say a table of obstacles (n, 5) or of a path (n, 3), perhaps an empty one."""
    return message(kind, floats(value for row in table for value in row))


def model(numbers: Mapping[str, Any]) -> bytes:
    """Say a model: what `kmpc_lite.embedded.model_numbers` works out, in its order.

    Parameters
    ----------
    numbers : mapping
        Arrays by name: whole ones first, then the others.
    """
    whole = [int(v) for a in numbers.values() if a.dtype.kind == "i" for v in a.ravel()]
    real = [float(v) for a in numbers.values() if a.dtype.kind != "i" for v in a.ravel()]
    return message(Kind.MODEL, struct.pack(f"<{len(whole)}h", *whole) + floats(real))


def parse(body: bytes, stamp: float) -> About | Telemetry | None:
    """Read what a board says, came at `stamp` [s]; None for all else."""
    if len(body) < 2 or body[0] != VERSION:
        return None
    payload = body[2:]
    if body[1] == Kind.ABOUT and len(payload) == ABOUT.size:
        horizon, history, circles, poses, dt, radius, *bounds = ABOUT.unpack(payload)
        low, high = (bounds[0], bounds[2]), (bounds[1], bounds[3])
        return About(horizon, history, circles, poses, dt, radius, low, high)
    if body[1] != Kind.STATE or len(payload) != STATE.size:
        return None
    now, number, good, bad, standing, status, passes, poses, age, *rest = STATE.unpack(payload)
    if standing >= len(STANDING) or status >= len(STATUSES):
        return None
    return Telemetry(
        now / 1e3,
        number,
        good,
        bad,
        STANDING[standing],
        STATUSES[status],
        passes,
        poses,
        float("inf") if age == NO_POSE else age / 1e3,
        (rest[0], rest[1]),
        (rest[2], rest[3], rest[4]),
        stamp,
    )


def decoder() -> CobsFrames:
    """Cut bytes from a board, or for one, into messages."""
    return CobsFrames(LONGEST)
