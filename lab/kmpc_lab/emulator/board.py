"""What the emulated motor controllers share: link, clock, faults, and the robot under the board."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self, TypedDict, Unpack

from firmware_bridge.drivers.motor_board import geometry_of
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.server import line_speed, serve
from firmware_bridge.options import from_table
from kmpc_lab.emulator.body import Body

MOTOR_LAG = 0.05


class Scene(TypedDict, total=False):
    """What a board finds around it: the parameters of `BoardEmulator` behind the geometry."""

    slip: float
    turn_gain: float
    seed: int
    clock: Callable[[], float]
    baud: int | None


class BoardEmulator:
    """A motor controller with a robot under it.

    Nothing runs by itself: each question, and each look at the robot, first brings the robot and
    the watchdog up to the clock.

    `geometry`: of the robot. `slip`, `turn_gain`, `seed`: of the floor: see `kmpc_lab.sim.plants`.
    `clock`: monotonic time [s]. `baud`: what the board's port is set to; a pseudo-terminal at
    another speed carries garbage both ways.
    """

    boot_text = b""
    options_type: ClassVar[type[Any]]
    """Of the ``[board]`` section, the driver's own."""

    def __init__(
        self,
        geometry: Geometry,
        *,
        slip: float = 0.0,
        turn_gain: float = 1.0,
        seed: int = 0,
        clock: Callable[[], float] = time.monotonic,
        baud: int | None = None,
    ) -> None:
        self._geometry, self._clock, self._baud = geometry, clock, baud
        self._body = Body(geometry, slip, turn_gain, seed, MOTOR_LAG, clock())
        self._lock = threading.RLock()
        self._random = random.Random(seed)
        self._transport: Transport | None = None
        self._zero = list(geometry.still)
        self.mute = False
        """Hears, and never answers."""
        self.lose_replies = 0
        """So many answers are lost next."""

    @classmethod
    def from_options(cls, table: Mapping[str, Any], **around: Unpack[Scene]) -> Self:
        """Build it from the same robot file as the driver."""
        geometry = geometry_of(table)
        # each board's second argument are its options
        build: Callable[..., Self] = cls
        return build(
            geometry, from_table(cls.options_type, table.get("board", {}), "board"), **around
        )

    def put_on(self, body: Body) -> None:
        """Put another robot under the board, before anything moves."""
        with self._lock:
            self._body = body

    @property
    def geometry(self) -> Geometry:
        """Of the robot file."""
        return self._geometry

    def start(self, url: str) -> None:
        """Serve a link; LinkError if it cannot be made."""
        transport = serve(url)
        transport.start(self._receive)
        self._transport = transport

    def close(self) -> None:
        """Pull the plug; `start` puts it back in, and the robot is where it was."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m] and theta [rad], not wrapped."""
        with self._lock:
            self._advance()
            return self._body.pose

    @property
    def wheel_command(self) -> tuple[float, ...]:
        """Set-points of the wheels [rad/s]; zero for motors that are let go."""
        with self._lock:
            self._advance()
            asked = [
                speed if driven else 0.0
                for speed, driven in zip(self._body.command, self._body.driven, strict=True)
            ]
            return self._geometry.from_channels(*asked)

    @property
    def stopped(self) -> bool:
        """Whether all set-points are zero."""
        return not any(self.wheel_command)

    @property
    def connected(self) -> bool:
        """Whether somebody is at the other end, as far as the link can tell."""
        return self._transport is not None and self._transport.connected

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down somewhere: [m], [m], [rad]."""
        with self._lock:
            self._body.place(x, y, theta)

    def handle(self, data: bytes) -> bytes:
        """Take bytes off the wire at the time of the clock; returns what the board answers."""
        with self._lock:
            self._advance()
            reply = self._answer(data, self._clock())
            if self.mute:
                return b""
            if reply and self.lose_replies:
                self.lose_replies -= 1
                return b""
            return reply

    def say(self, data: bytes) -> None:
        """Send bytes that nobody asked for."""
        if self._transport is not None:
            self._transport.write(data)

    def reboot(self) -> None:
        """Switch off and on: the board boots with saved settings, zero counters, no set-points."""
        with self._lock:
            self._advance()
            self._let_go_all()
            self._zero = list(self._body.turns)
            self._reset()
        self.say(self.boot_text)

    # What a board adds

    def _answer(self, data: bytes, now: float) -> bytes:
        raise NotImplementedError

    def _watchdog(self, now: float) -> None:
        raise NotImplementedError

    def _reset(self) -> None:
        raise NotImplementedError

    def _turns(self, channel: int) -> float:
        """Motor turns since the counter was zero."""
        return self._body.turned(channel, self._clock()) - self._zero[channel]

    def _set(self, channel: int, turns_per_second: float) -> None:
        self._body.command[channel], self._body.driven[channel] = turns_per_second, True

    def _let_go(self, channel: int) -> None:
        self._body.command[channel], self._body.driven[channel] = 0.0, False

    def _let_go_all(self) -> None:
        for channel in range(len(self._body.command)):
            self._let_go(channel)

    def _advance(self) -> None:
        self._body.advance(self._clock(), self._watchdog)

    def _receive(self, data: bytes, stamp: float) -> None:
        transport = self._transport
        if transport is None:
            return
        wrong = self._baud is not None and line_speed(transport) not in (None, self._baud)
        reply = self.handle(self._garbled(data) if wrong else data)
        if reply:
            transport.write(self._garbled(reply) if wrong else reply)

    def _garbled(self, data: bytes) -> bytes:
        return self._random.randbytes(self._random.randint(1, len(data) + 1))
