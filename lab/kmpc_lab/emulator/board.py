"""What the emulated motor controllers share: link, clock, faults, and the robot under the board."""

from __future__ import annotations

import math
import random
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol, Self, TypedDict, Unpack

import numpy as np

from firmware_bridge.drivers.motor_board import geometry_of
from firmware_bridge.kinematics import CarGeometry, Geometry, OmniGeometry
from firmware_bridge.link import Transport
from firmware_bridge.link.server import line_speed, serve
from firmware_bridge.messages import command_of
from firmware_bridge.options import from_table
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.sim.plants.steered import MecanumDrive, SteeredDrive
from kmpc_lite.control.wheels import Car

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
    options_type: ClassVar[type[Any]]  # of the ``[board]`` section, the driver's own

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
        self.mute = False  # hears, and never answers
        self.lose_replies = 0  # so many answers are lost next

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


STEP = 0.01  # [s]
TOP = 3.0  # motors go no faster than so many times the robot's limit
COAST = 0.4  # time constant of a motor that is let go [s]
SERVO = 0.3  # from lock to lock a car's servo takes at least so long [s]
UNDERSTEER = 0.5  # of a car, for each 1 of the floor's slip ratio [s^2/m^2]
STILL = 1e-3  # slower wheels stand [rad/s]


class Floor(Protocol):
    """What the wheels roll on: `kmpc_lab.sim.plants`."""

    def trace(self, x: Any, u: Any, dt: float, substeps: int) -> Any:
        """States (substeps, 3) during one period."""


class Body:
    """Wheels and a pose.

    `geometry`: of the robot. `slip`, `turn_gain`, `seed`: of the floor: see `kmpc_lab.sim.plants`.
    `lag`: time constant of the driven motors [s]. `now`: time of the clock at the start [s].
    """

    def __init__(
        self, geometry: Geometry, slip: float, turn_gain: float, seed: int, lag: float, now: float
    ) -> None:
        self._geometry, self._lag = geometry, lag
        self._floor, self._turn_gain = _floor(geometry, slip, seed), turn_gain
        self._start, self._steps = now, 0
        self._top = (
            TOP * geometry.max_wheel_speed / geometry.wheel_radius * geometry.gear_ratio / math.tau
        )
        self._pose = np.zeros(3)
        self.command = list(geometry.still)  # set-points of the channels, motor turns per second
        self.driven = [True] * len(self.command)
        self.ramp = math.inf  # how fast the motors approach their set-points [turns/s^2]
        self.speeds = list(geometry.still)  # motor turns per second
        self._ramped = list(geometry.still)
        self.turns = list(geometry.still)  # motor turns since the start
        self.steered = 0.0
        """Where a car's servo is to be, as a share of its largest angle, to the left."""
        self._curvature = 0.0

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m] and theta [rad], not wrapped."""
        return float(self._pose[0]), float(self._pose[1]), float(self._pose[2])

    def turned(self, channel: int, now: float) -> float:
        """Motor turns at `now`, between two steps too: encoders know no steps."""
        return self.turns[channel] + self.speeds[channel] * max(
            0.0, now - self._start - self._steps * STEP
        )

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down somewhere."""
        self._pose = np.array((x, y, theta))

    def advance(self, now: float, watchdog: Callable[[float], None]) -> None:
        """Step up to `now`; `watchdog` is called with the time before each step, and at the end."""
        last = math.floor((now - self._start) / STEP)
        while self._steps < last:
            moves = any((*self.command, *self.speeds, *self._ramped))
            if not moves and self._wanted == self._curvature:
                self._steps = last  # nothing moves
                break
            watchdog(self._start + self._steps * STEP)
            self._step()
            self._steps += 1
        watchdog(now)

    @property
    def _wanted(self) -> float:
        """Curvature to which a car's servo turns [1/m]."""
        if not isinstance(self._geometry, CarGeometry):
            return 0.0
        return math.tan(self.steered * self._geometry.steering_angle) / self._geometry.wheelbase

    def _steer(self) -> None:
        """Turn a car's servo for a step."""
        if isinstance(self._geometry, CarGeometry):
            fastest = 2.0 * self._geometry.sharpest / SERVO
            most = STEP * min(fastest, self._geometry.steering_rate or fastest)
            change = self._wanted - self._curvature
            self._curvature += min(max(change, -most), most)

    def _step(self) -> None:
        self._steer()
        for i in range(len(self.speeds)):
            change = min(max(self.command[i], -self._top), self._top) - self._ramped[i]
            self._ramped[i] += math.copysign(min(abs(change), self.ramp * STEP), change)
            target, lag = (self._ramped[i], self._lag) if self.driven[i] else (0.0, COAST)
            speed = target + (self.speeds[i] - target) * (math.exp(-STEP / lag) if lag else 0.0)
            if target == 0.0 and abs(speed) * math.tau < STILL:
                speed = 0.0
            self.turns[i] += (self.speeds[i] + speed) / 2.0 * STEP
            self.speeds[i] = speed
        wheels = self._geometry.from_channels(*self.speeds)
        v, omega, vy = self._geometry.body(wheels, self._curvature)
        inputs = 3 if isinstance(self._geometry, OmniGeometry) else 2
        command = command_of((v, self._turn_gain * omega, vy), inputs)
        self._pose = self._floor.trace(self._pose, command, STEP, 1)[-1]


def _floor(geometry: Geometry, slip: float, seed: int) -> Floor:
    """What wheels of a kind roll on."""
    if isinstance(geometry, CarGeometry):
        return SteeredDrive(Car(1.0 / geometry.sharpest), slip, UNDERSTEER * slip, seed=seed)
    if isinstance(geometry, OmniGeometry):
        return MecanumDrive(slip, seed)
    return DifferentialDrive(slip=slip, seed=seed)
