"""What is sent against which surface of a bridge."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from firmware_bridge.drivers.boards import BOARDS

SIZE = 65536


@dataclass(frozen=True)
class Surface:
    """Where a bridge can be reached."""

    name: str
    driver: str
    """Of the robot that is driven meanwhile."""
    between: str = ""
    """Attacker (attacker.KINDS) that stands in the link, whether it attacks or not."""
    poses: bool = False
    """Whether the robot is driven by poses from outside."""
    page: bool = False
    """Whether it is shown on a live page, whose STOP is pressed then."""
    shared: bool = False
    """Whether ground stations share it."""
    lidar: str = ""
    """Of the robot, on a link in which another attacker stands; none if empty."""


@dataclass(frozen=True)
class Flood:
    """One attack."""

    surface: Surface
    name: str
    rubbish: Callable[[], bytes]
    beside: str = ""
    """Attacker that comes from beside; none: the one that stands in the link floods it."""
    also: tuple[Flood, ...] = ()
    """What comes at the same time, on this one's surface."""


def noise() -> bytes:
    """Random bytes, the same in every run."""
    return random.Random(14).randbytes(SIZE)


def markers() -> bytes:
    """First bytes of frames, and nothing behind them."""
    return b"\xfe" * SIZE


def strangers() -> bytes:
    """Valid MAVLink frames of another system."""
    return _frames(77, 0)


def torn() -> bytes:
    """Frames of the vehicle, each without its last bytes."""
    return _frames(1, 3)


def questions() -> bytes:
    """Requests that look as if they came from the vehicle, each to be answered."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec

    codec = MavlinkCodec(1, 1)
    ask = dialect.MAVLink_timesync_message
    return b"".join(codec.encode(ask(0, i + 1)) for i in range(2000))


def lines() -> bytes:
    """Answers that nobody asked for, of boards that speak in lines."""
    return b"0.0 0.0\r1.0\rC=1:2\r" * (SIZE // 20)


def malformed() -> bytes:
    """Datagrams that look like poses and are none."""
    return b'{"stamp": 1e999, "x": [[[[[[1]]]]]], "y": "z"}'.ljust(100) * (SIZE // 100)


def all_sorts() -> bytes:
    """Everything that a MAVLink link may be flooded with, in turns."""
    sorts = (strangers(), markers(), torn(), questions(), noise())
    return b"".join(part[at : at + 4096] for at in range(0, SIZE // 5, 4096) for part in sorts)


def headers() -> bytes:
    """First bytes of an LD06's packets, with a CRC to be looked at behind every second byte."""
    return b"\x54\x2c" * (SIZE // 2)


def whirl() -> bytes:
    """Nodes of an RPLIDAR, each right, of a turn after the other without end."""
    from firmware_bridge.sensors.lidar.rplidar_frames import CIRCLE, Node

    turn = [Node(i * CIRCLE // 400, 4000, 40, i == 0).to_bytes() for i in range(400)]
    return b"".join(turn) * (SIZE // 2000)


def orders() -> bytes:
    """Frames of a ground station: parameters, commands, and set-points that are refused."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec

    codec = MavlinkCodec(255, 190)
    name = dialect.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1)
    move = dialect.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 8, 0x5C7, 0.0, 0.0, 0.0, -1.0, *[0.0] * 6, 1.0
    )
    slow = dialect.MAVLink_request_data_stream_message(1, 1, 0, 1, 1)
    return b"".join(codec.encode(message) for _ in range(500) for message in (name, move, slow))


def nothing() -> bytes:
    """Nothing: the attack lies in the connections."""
    return b""


def _frames(system: int, cut: int) -> bytes:
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec

    codec = MavlinkCodec(system, 1)
    attitude = dialect.MAVLink_attitude_message
    frames = [codec.encode(attitude(i, 0.1, 0.2, 0.3, 0.0, 0.0, 0.5)) for i in range(SIZE // 40)]
    return b"".join(frame[: len(frame) - cut] for frame in frames)


TCP = Surface("MAVLink, TCP", "mavlink", "tcp")
UDP = Surface("MAVLink, UDP", "mavlink", "udp")
POSES = Surface("pose socket", "roboclaw", "tcp", poses=True)
ESTOP = Surface("emergency stop's socket", "roboclaw", "tcp")
PAGE = Surface("live page", "roboclaw", "tcp", page=True)
FORWARD = Surface("forward port", "mavlink", "tcp", shared=True)
MOTOR_BOARDS = {
    name: Surface(board.label, name, "tcp", poses=not board.encoders)
    for name, board in BOARDS.items()
    if name != "mavlink"
}
LIDARS = {
    name: Surface(f"lidar {name}", "roboclaw", "tcp", lidar=name) for name in ("ld06", "rplidar")
}
EVERYTHING = Flood(
    Surface("MAVLink with poses", "mavlink", "tcp", poses=True),
    "all of these at once",
    all_sorts,
    also=(
        Flood(POSES, "poses", malformed, "beside"),
        Flood(ESTOP, "hog", nothing, "hog"),
        Flood(ESTOP, "idle", nothing, "idle"),
    ),
)
FLOODS = (
    Flood(TCP, "frames of another system", strangers),
    Flood(TCP, "0xFE", markers),
    Flood(TCP, "torn frames", torn),
    Flood(TCP, "questions in the vehicle's name", questions),
    Flood(UDP, "frames of another system", strangers),
    Flood(UDP, "0xFE", markers),
    Flood(UDP, "noise", noise),
    *(Flood(board, "noise", noise) for board in MOTOR_BOARDS.values()),
    Flood(MOTOR_BOARDS["odrive"], "answers nobody asked for", lines),
    Flood(POSES, "malformed, of the source itself", malformed, "poses"),
    Flood(POSES, "a stranger's", malformed, "beside"),
    Flood(LIDARS["ld06"], "headers", headers, "lidar"),
    Flood(LIDARS["rplidar"], "turns without end", whirl, "lidar"),
    Flood(LIDARS["rplidar"], "noise", noise, "lidar"),
    Flood(ESTOP, "connections without end", nothing, "hog"),
    Flood(ESTOP, "nine idle, one that trickles", nothing, "idle"),
    Flood(PAGE, "half requests, noise, and watchers that read nothing", noise, "browsers"),
    Flood(FORWARD, "a station's frames without end", orders, "station"),
    Flood(FORWARD, "noise", noise, "station"),
    EVERYTHING,
)
