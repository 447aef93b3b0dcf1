"""RoboClaw over packet serial (Basicmicro user manual, chapter Packet Serial)."""

from __future__ import annotations

import math
import struct
from collections.abc import Hashable
from dataclasses import dataclass

from firmware_bridge.drivers.polled import NoReply, PolledDriver
from firmware_bridge.drivers.polled.options import PolledOptions, counts_per_metre
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import RoboClawReplies, roboclaw_packet, roboclaw_request
from firmware_bridge.messages import LinkError
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded

SET_TIMEOUT = 14
GET_TIMEOUT = 15
DUTY = 34
SPEED = 37
SPEED_ACCEL = 40
COUNTS = 78
RAW_SPEEDS = 79
STATUS = 90
STATUS_32 = (
    "emergency stop",
    "temperature",
    "temperature 2",
    "main voltage high",
    "logic voltage high",
    "logic voltage low",
    "M1 driver fault",
    "M2 driver fault",
    "M1 speed error: encoder lost?",
    "M2 speed error: encoder lost?",
    "M1 position error",
    "M2 position error",
    "M1 current",
    "M2 current",
    "",
    "",
    "M1 over-current warning",
    "M2 over-current warning",
    "main voltage high warning",
    "main voltage low warning",
    "temperature warning",
    "temperature 2 warning",
    "S4 triggered",
    "S5 triggered",
    "speed error limit warning",
    "position error limit warning",
)
"""Bits of the 4-byte status."""
STATUS_16 = (
    "M1 over-current warning",
    "M2 over-current warning",
    "emergency stop",
    "temperature",
    "temperature 2",
    "main voltage high",
    "logic voltage high",
    "logic voltage low",
    "M1 driver fault",
    "M2 driver fault",
    "main voltage high warning",
    "main voltage low warning",
    "temperature warning",
    "temperature 2 warning",
    "M1 home",
    "M2 home",
)
"""Bits of the 2-byte status of firmware before 4.1.20 or so."""
STOPPING_32, STOPPING_16 = 0x0000FFFF, 0x000003FC
ENCODER_LOST = 0x00000300


@dataclass(frozen=True, kw_only=True)
class RoboClawOptions(PolledOptions):
    """The ``[board]`` section of a robot file."""

    counts_per_turn: float = bounded(1.0, 1e7)
    """Quadrature counts per turn of the shaft that carries the encoder; the geometry's gear ratio
    is from there to the wheel."""
    address: int = bounded(0x80, 0x87, "", 0x80)
    watchdog: float = bounded(0.1, 25.5, "s", 0.5)
    """The board stops the motors when it hears nothing for so long [s], in steps of 0.1 s."""
    acceleration: float | None = bounded(1e-3, 1e3, "m/s^2", None)
    """Of the rim, by the board [m/s^2]; none: as fast as its speed loop can."""
    command_timeout: float = bounded(0.05, 10.0, "s", 0.5)
    """The driver sends zero when the last command is older [s]: its questions alone would feed the
    board's watchdog."""


def status_words(status: int, size: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Errors that stop the motors, and warnings, of a status register of 2 or 4 bytes."""
    names, stopping = (STATUS_32, STOPPING_32) if size == 4 else (STATUS_16, STOPPING_16)
    known = [
        (bit, names[bit] if bit < len(names) and names[bit] else f"status bit {bit}")
        for bit in range(8 * size)
        if status >> bit & 1
    ]
    return tuple(name for bit, name in known if stopping >> bit & 1), tuple(
        name for bit, name in known if not stopping >> bit & 1
    )


class RoboClawDriver(PolledDriver):
    """Two motors on one RoboClaw.

    Commands 37 or 40 set speeds, 78 reads counters, 79 speeds, 90 status, 14 and 15 set and
    read the time-out.
    """

    board = "RoboClaw"
    options_type = RoboClawOptions

    def __init__(self, transport: Transport, geometry: Geometry, options: RoboClawOptions) -> None:
        odometry = WheelOdometry(geometry, options.counts_per_turn, wraps=True)
        super().__init__(transport, geometry, odometry, options)
        per_metre = counts_per_metre(geometry, options.counts_per_turn)
        self._counts_per_turn, self._address = options.counts_per_turn, options.address
        self._watchdog = math.ceil(round(options.watchdog * 10.0, 6))
        self._acceleration = (
            None
            if options.acceleration is None
            else max(1, round(options.acceleration * per_metre))
        )
        self._replies = RoboClawReplies()
        self._status_bytes = 4
        self.hint = (
            "is it powered, wired TX to RX, in packet serial mode at address "
            f"{options.address:#x} and at this baud rate?"
        )

    def _configure(self) -> None:
        try:
            self._read(STATUS, 4)
            self._status_bytes = 4
        except NoReply:
            self._settle()
            self._read(STATUS, 2)
            self._status_bytes = 2
        self._drive(*self._geometry.still)
        self._write(SET_TIMEOUT, bytes((self._watchdog,)))
        if not self._watchdog_is_set():
            raise LinkError(
                f"the board did not take a serial time-out of {self._watchdog / 10:g} s"
            )

    def _poll(self, cycle: int) -> None:
        counts, stamp = self._read(COUNTS, 8)
        speeds, _ = self._read(RAW_SPEEDS, 8)
        first, second = struct.unpack(">ii", speeds)
        self._moved(
            struct.unpack(">ii", counts),
            (first / self._counts_per_turn, second / self._counts_per_turn),
            stamp,
        )
        if cycle % 5 == 0:
            status = int.from_bytes(self._read(STATUS, self._status_bytes)[0], "big")
            self._errors, self._warnings = status_words(status, self._status_bytes)
            self._estimate_ok = not (self._status_bytes == 4 and status & ENCODER_LOST)
        if cycle % 25 == 12 and not self._watchdog_is_set():
            self._restarted()

    def _barrier(self) -> None:
        self._read(GET_TIMEOUT, 1)

    def _watchdog_is_set(self) -> bool:
        return self._read(GET_TIMEOUT, 1)[0][0] == self._watchdog

    def _drive(self, *turns: float) -> None:
        first, second = turns
        speeds = struct.pack(
            ">ii", round(first * self._counts_per_turn), round(second * self._counts_per_turn)
        )
        if self._acceleration is None:
            self._write(SPEED, speeds)
        else:
            self._write(SPEED_ACCEL, struct.pack(">I", self._acceleration) + speeds)

    def _release(self) -> None:
        self._write(DUTY, bytes(4))

    def _write(self, command: int, payload: bytes) -> None:
        self._exchange.ask(roboclaw_packet(self._address, command, payload), (command, 0))

    def _read(self, command: int, size: int) -> tuple[bytes, float]:
        return self._ask(roboclaw_request(self._address, command), (command, size))

    def _begin(self, key: Hashable) -> None:
        assert isinstance(key, tuple)
        self._replies.expect(self._address, *key)

    def _feed(self, data: bytes, stamp: float) -> None:
        with self._changed:
            key, payload = self._exchange.expected, self._replies.feed(data)
        if payload is not None:
            self._exchange.deliver(key, payload, stamp)
        elif key is None:
            self._exchange.deliver(None, data, stamp)

    def _damaged(self) -> int:
        return self._replies.bad
