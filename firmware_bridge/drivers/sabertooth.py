"""Sabertooth and SyRen over packet serial (Dimension Engineering's manuals): commands only.

Nothing is heard of such a board: neither whether it is there, nor how the wheels turn. The pose
must come from outside (`link.pose`), which also shows whether the robot follows its commands.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from firmware_bridge.drivers.motor_board import TickingDriver
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.messages import ConfigError, LinkError, LinkStatus, State
from firmware_bridge.options import bounded, check

BAUDING = b"\xaa"  # sets the speed of boards that find it out; others pass over it
FORWARD, BACKWARD, TIMEOUT = (0, 4), (1, 5), 14
"""Commands: drive motor 1 and 2, and the serial time-out."""
FULL = 127  # data of full power
TIMEOUT_UNIT = 0.1  # of the serial time-out [s]; a SyRen's and a Sabertooth's own
TICK = 0.05  # between repetitions of the last command [s]
REMIND = 1.0  # between repetitions of the time-out: a board that was off has forgotten it [s]


def packet(address: int, command: int, data: int) -> bytes:
    """Build a packet: address, command, data, and the low seven bits of their sum.

    Examples
    --------
    >>> packet(128, 0, 64).hex(" ")
    '80 00 40 40'
    """
    return bytes((address, command, data, (address + command + data) & 0x7F))


@dataclass(frozen=True)
class SabertoothOptions:
    """The ``[board]`` section of a robot file."""

    full_speed: float = bounded(0.01, 100.0, "m/s")
    """Speed of a wheel's rim at full power [m/s], measured: power is proportional to speed, more is
    not known here."""
    address: int = bounded(128, 135, "", 128)
    second_address: int | None = bounded(128, 135, "", None)
    """Of the second motor's board: two SyRen 10 or 25 drive a motor each; none: one Sabertooth
    drives both."""
    watchdog: float = bounded(0.1, 12.7, "s", 0.3)
    """The board stops the motors when it hears nothing for so long [s], in steps of 0.1 s."""
    command_timeout: float = bounded(0.05, 10.0, "s", 0.25)
    """The driver sends zero when the last command is older [s]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)
        if self.second_address == self.address:
            raise ConfigError(f"second_address: expected another than address, got {self.address}")


class SabertoothDriver(TickingDriver):
    """Two motors, by power.

    `transport`: not yet started; the driver starts and closes it. `geometry`: of the robot.
    `options`: addresses, full speed, watchdog.
    """

    board, options_type, tick = "Sabertooth", SabertoothOptions, TICK

    def __init__(
        self, transport: Transport, geometry: Geometry, options: SabertoothOptions
    ) -> None:
        if geometry.max_wheel_speed > options.full_speed:
            raise ConfigError(
                f"board.full_speed: expected at least geometry.max_wheel_speed "
                f"({geometry.max_wheel_speed:g} m/s), got {options.full_speed:g}"
            )
        super().__init__(transport, geometry)
        self._options = options
        wheel = options.full_speed / geometry.wheel_radius
        self._full = wheel * geometry.gear_ratio / math.tau
        self._watchdog = math.ceil(round(options.watchdog / TIMEOUT_UNIT, 6))
        self._command, self._wheels = (0, 0), geometry.still
        self._stamp = self._reminded = -math.inf
        self._links = -1
        self._counters = dict.fromkeys(("stale_commands", "refused_commands", "setups"), 0)

    def connect(self, timeout: float) -> None:
        """Open the link and stop the motors; whether a board is there is unknown."""
        self._start(lambda data, stamp: None)
        with self._lock:
            if not self._lock.wait_for(lambda: self._counters["setups"] > 0, timeout):
                raise LinkError(f"Sabertooth: {self._transport.last_error or 'the link is down'}")

    def state(self) -> State | None:
        """Speeds as commanded, at the origin: only a pose from outside makes a pose of it."""
        v, omega, _ = self._geometry.body(self._wheels)
        return State(0.0, 0.0, 0.0, v, omega, time.monotonic())

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command speeds; written at once."""
        wheels = self._geometry.wheels(v, omega, vy)
        first, second = self._geometry.to_channels(*wheels)
        with self._lock:
            if not any(wheels):
                self._released = False  # only standing still may take the motors back
            elif self._released:
                self._counters["refused_commands"] += 1
                return
            self._set(self._power(first), self._power(second), wheels)

    def health(self) -> LinkStatus:
        """What is known: whether the link is open."""
        now, connected = time.monotonic(), self._transport.connected
        trouble = self._transport.last_error
        return LinkStatus(
            connected=connected,
            heartbeat_stamp=now if connected else -math.inf,
            pose_stamp=-math.inf,
            ready=connected and not self._released,
            armed=not self._released,
            mode="commands only: nothing is heard of the board",
            faults=() if connected or not trouble else (trouble,),
            counters={**self._transport.counters, **self._counters},
        )

    def _power(self, turns_per_second: float) -> int:
        share = turns_per_second / self._full
        return max(-FULL, min(FULL, round(FULL * share)))

    def _set(self, first: int, second: int, wheels: tuple[float, ...]) -> None:
        self._command, self._wheels, self._stamp = (first, second), wheels, time.monotonic()
        self._write()

    def _write(self) -> None:
        """Put both motors' command on the wire as one frame."""
        options, frame = self._options, b""
        for motor, power in enumerate(self._command):
            # the second of two boards drives its own first motor
            own = options.second_address is not None and motor == 1
            address = options.second_address if own else options.address
            assert address is not None
            kind = FORWARD if power >= 0 else BACKWARD
            frame += packet(address, kind[0 if own else motor], abs(power))
        self._transport.write(frame)

    def _set_up(self) -> None:
        """Send bauding character and time-out: a board that was switched on has neither."""
        addresses = {self._options.address, self._options.second_address or self._options.address}
        self._transport.write(
            BAUDING + b"".join(packet(a, TIMEOUT, self._watchdog) for a in addresses)
        )

    def _halt(self) -> None:
        self._set(0, 0, self._geometry.still)

    def _remind(self, now: float) -> None:
        links = self._transport.counters["reconnects"]
        if not self._transport.connected:
            return
        if links != self._links or now - self._reminded >= REMIND:
            self._reminded, self._links = now, links
            self._set_up()
            self._counters["setups"] += 1
            self._lock.notify_all()
        if self._command != (0, 0) and now - self._stamp > self._options.command_timeout:
            self._counters["stale_commands"] += 1
            self._command, self._wheels = (0, 0), self._geometry.still
        if self._command == (0, 0):
            self._write()  # a repeated zero; anything else is for the gate to repeat
