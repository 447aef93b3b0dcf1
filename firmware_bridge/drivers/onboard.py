"""A microcontroller with an exported controller: drives to a goal by itself, or as it is told.

Messages are those of `messages.h` and `host.c` of an export.
"""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from firmware_bridge.drivers.motor_board import TickingDriver
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import CobsFrames, cobs_frame
from firmware_bridge.messages import LinkError, LinkStatus, State
from firmware_bridge.options import bounded, check

VERSION, PAYLOAD = 1, 1024  # of the messages, and bytes of one at most
TICK, REPEAT = 0.1, 3
"""Between heartbeats [s]: the board stops without any for 0.5 s; and heartbeats between repetitions
of obstacles and path, which hold for 1 and 2 s."""
SILENT, WAYS = 0.5, 50
"""Telemetry that is older shows a board that is gone [s]; how many tell the board's clock."""
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
ABOUT, STATE = struct.Struct("<4B6f"), struct.Struct("<4I4BH5f")
NO_POSE = 0xFFFF  # age of a pose that was never said, or long ago [ms]


class Kind(IntEnum):
    """What a message is; the board's own are from 128 on."""

    HEARTBEAT, POSE, GOAL, OBSTACLES, PATH = range(1, 6)
    VELOCITY, ESTOP, RELEASE, ASK = range(7, 11)  # 6 was a model
    ABOUT, STATE, WHEELS = range(128, 131)


class About(NamedTuple):
    """The controller of a board.

    Stages, past commands that its model depends on, circles and poses of a path at most, period
    [s], radius [m], and bounds of commands [m/s, rad/s].
    """

    horizon: int
    history: int
    circles: int
    poses: int
    dt: float
    radius: float
    u_min: tuple[float, float]
    u_max: tuple[float, float]


class Telemetry(NamedTuple):
    """What a board says of itself, ten times a second.

    Its clock [s], the newest heartbeat, messages understood and refused, why it stands, its plan's
    status and passes, poses of the path, age of the pose [s], command [m/s, rad/s], pose [m, m,
    rad], and when it came on our clock [s].
    """

    uptime: float
    heartbeat: int
    good: int
    bad: int
    standing: str
    status: str
    passes: int
    poses: int
    pose_age: float
    command: tuple[float, float]
    pose: tuple[float, float, float]
    stamp: float


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


def numbers(kind: Kind, values: Iterable[float], uptime: float | None = None) -> bytes:
    """Say numbers as singles, and when on the board's clock [s] they were true, if that matters."""
    packed = b"".join(struct.pack("<f", value) for value in values)
    stamp = b"" if uptime is None else struct.pack("<I", round(1e3 * uptime) & 0xFFFFFFFF)
    return message(kind, packed + stamp)


def rows(kind: Kind, table: Sequence[Sequence[float]]) -> bytes:
    """Say a table of obstacles (n, 5) or of a path (n, 3), perhaps an empty one."""
    return numbers(kind, (value for row in table for value in row))


def heartbeat(number: int) -> bytes:
    """Say that the host is there."""
    return message(Kind.HEARTBEAT, struct.pack("<I", number & 0xFFFFFFFF))


def parse(body: bytes, stamp: float) -> About | Telemetry | None:
    """Read what a board says, came at `stamp` [s]; None for all else."""
    kind, payload = body[1:2], body[2:]
    if body[:1] != bytes((VERSION,)):
        return None
    if kind == bytes((Kind.ABOUT,)) and len(payload) == ABOUT.size:
        n, past, circles, most, dt, radius, v0, v1, w0, w1 = ABOUT.unpack(payload)
        return About(n, past, circles, most, dt, radius, (v0, w0), (v1, w1))
    if kind != bytes((Kind.STATE,)) or len(payload) != STATE.size:
        return None
    now, number, good, bad, why, status, passes, poses, age, *rest = STATE.unpack(payload)
    if why >= len(STANDING) or status >= len(STATUSES):
        return None
    words, old = (STANDING[why], STATUSES[status]), math.inf if age == NO_POSE else age / 1e3
    command, at = (rest[0], rest[1]), (rest[2], rest[3], rest[4])
    return Telemetry(now / 1e3, number, good, bad, *words, passes, poses, old, command, at, stamp)


def decoder() -> CobsFrames:
    """Cut bytes from a board, or for one, into messages."""
    return CobsFrames(PAYLOAD + 12)


def _table(name: str, values: Sequence[Sequence[float]], columns: int, most: int) -> list[Any]:
    """Check rows of finite numbers."""
    table = [tuple(float(value) for value in row) for row in values]
    sound = all(len(row) == columns and all(map(math.isfinite, row)) for row in table)
    if len(table) > most or not sound:
        raise ValueError(
            f"{name}: expected at most {most} rows of {columns} finite numbers, got {len(table)}"
        )
    return table


@dataclass(frozen=True)
class OnboardOptions:
    """The ``[board]`` section of a robot file."""

    command_timeout: float = bounded(0.05, 10.0, "s", 0.2)
    """The driver sends zero when the last speeds are older [s]; the board stops after 0.25 s."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


class OnboardDriver(TickingDriver):
    """The near end of a link to `host.c` of an export.

    `send` has the board drive at a speed, as any motor controller; `drive_to` has it drive by
    itself, as long as it is fed with poses. Heartbeats go out all the time.
    """

    board, options_type, tick = "Onboard", OnboardOptions, TICK

    def __init__(self, transport: Transport, geometry: Geometry, options: OnboardOptions) -> None:
        super().__init__(transport, geometry)
        self._options, self._frames = options, decoder()
        self._command, self._stamp, self._beats = (0.0, 0.0), -math.inf, 0
        self._task = b""
        self._pose, self._pose_stamp = (0.0, 0.0, 0.0), -math.inf
        self._ways: deque[float] = deque(maxlen=WAYS)
        """Our clock less the board's, of each telemetry: the fastest of them came at once."""
        self._counters = dict.fromkeys(("stale_commands", "refused_commands", "refused"), 0)
        self.about: About | None = None
        self.telemetry: Telemetry | None = None

    def connect(self, timeout: float) -> None:
        """Open the link, and ask the board what it is; LinkError if it does not answer."""
        self._start(self._on_bytes)
        with self._lock:
            known = self._lock.wait_for(lambda: self.about and self._ways, timeout)
        if not known:
            why = self._transport.last_error or (
                f"{self._frames.bad} frames came and none made sense: another baud rate or version?"
                if self._frames.bad
                else "is it powered, wired TX to RX, and running an exported controller?"
            )
            raise LinkError(f"onboard: no answer within {timeout:g} s: {why}")

    def state(self) -> State | None:
        """Speeds that it drives at; the pose that it was fed with, or the origin without any."""
        v, omega = (0.0, 0.0) if self.telemetry is None else self.telemetry.command
        with self._lock:
            fed = math.isfinite(self._pose_stamp)
            stamp = self._pose_stamp if fed else time.monotonic()
            return State(*self._pose, v, omega, stamp)

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Have it drive at a speed; a task is given up."""
        v, omega, _ = self._geometry.body(self._geometry.wheels(v, omega, vy))
        with self._lock:
            self._task = b""
            if (v, omega) == (0.0, 0.0):
                self._released = False  # only standing still may take the motors back
            elif self._released:
                self._counters["refused_commands"] += 1
                return
            self._set(v, omega)

    def drive_to(
        self,
        goal: Sequence[float],
        obstacles: Sequence[Sequence[float]] = (),
        path: Sequence[Sequence[float]] = (),
    ) -> None:
        """Have it drive to a goal (x, y, heading) by itself; again with what has changed.

        Obstacles are rows x, y, radius [m], vx, vy [m/s]; a path is rows x, y, heading that end at
        the goal. ValueError for numbers that are not finite, and for more than the board can hold.
        """
        circles, poses = (24, 64) if self.about is None else (self.about.circles, self.about.poses)
        task = rows(Kind.OBSTACLES, _table("obstacles", obstacles, 5, circles))
        task += rows(Kind.PATH, _table("path", path, 3, poses))
        task += rows(Kind.GOAL, _table("goal", [goal], 3, 1))
        with self._lock:
            self._task, self._command, self._released = task, (0.0, 0.0), False
            self._transport.write(task)

    def feed_pose(self, x: float, y: float, theta: float, stamp: float) -> None:
        """Pass on a pose from outside: [m, m, rad] at `time.monotonic()` [s]."""
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError(f"pose: expected finite numbers, got {(x, y, theta)}")
        with self._lock:
            self._pose, self._pose_stamp = (x, y, theta), stamp
            self._say(Kind.POSE, self._pose, stamp)

    def estop(self) -> None:
        """Stand at once, until `release`."""
        with self._lock:
            self._task = b""
            self._transport.write(message(Kind.ESTOP))

    def release(self) -> None:
        """End an emergency stop: the board has then heard nothing, and stands."""
        self._transport.write(message(Kind.RELEASE))

    def health(self) -> LinkStatus:
        """What is known of the board."""
        now, told = time.monotonic(), self.telemetry
        fresh = told is not None and now - told.stamp < SILENT
        stopped = told is not None and told.standing == STANDING[ESTOPPED]
        faults = (STANDING[ESTOPPED],) if stopped else ()
        if not fresh and self._started:
            faults = (*faults, self._transport.last_error or "the board is silent")
        counters = {} if told is None else {"board_frames": told.good, "board_refused": told.bad}
        return LinkStatus(
            connected=self._transport.connected,
            heartbeat_stamp=-math.inf if told is None else told.stamp,
            pose_stamp=self._pose_stamp,
            ready=fresh and not stopped and not self._released,
            armed=not self._released,
            mode="" if told is None else told.standing or "drives",
            faults=faults,
            counters={**self._transport.counters, **self._counters, **counters}
            | {"bad_frames": self._frames.bad},
        )

    def _halt(self) -> None:
        self._task = b""
        self._set(0.0, 0.0)

    def _set(self, v: float, omega: float) -> None:
        self._command, self._stamp = (v, omega), time.monotonic()
        self._say(Kind.VELOCITY, self._command, self._stamp)

    def _say(self, kind: Kind, values: Iterable[float], stamp: float) -> None:
        """Say what was true at a time of ours [s]; a board thought to be behind stops too early."""
        if self._ways:
            self._transport.write(numbers(kind, values, stamp - min(self._ways)))

    def _on_bytes(self, data: bytes, stamp: float) -> None:
        for body in self._frames.feed(data):
            said = parse(body, stamp)
            with self._lock:
                if isinstance(said, About):
                    self.about = said
                elif said is None:
                    self._counters["refused"] += 1
                else:
                    if self.telemetry is not None and said.uptime < self.telemetry.uptime:
                        self._ways.clear()  # it was switched off and on
                    self.telemetry = said
                    self._ways.append(stamp - said.uptime)
                self._lock.notify_all()

    def _remind(self, now: float) -> None:
        """Say that we are there, and what must be repeated."""
        self._transport.write(heartbeat(self._beats))
        if self.about is None:
            self._transport.write(message(Kind.ASK))
        if self._task:
            if self._beats % REPEAT == 0:
                self._transport.write(self._task)
        elif self._command == (0.0, 0.0):
            self._set(0.0, 0.0)  # a zero may be lost; anything else is for the gate to repeat
        elif now - self._stamp > self._options.command_timeout:
            self._counters["stale_commands"] += 1
            self._set(0.0, 0.0)
        self._beats += 1
