"""An ESP32 or Arduino with our line protocol: see examples/kmpc_wheels/PROTOCOL.md."""

from __future__ import annotations

import re
from dataclasses import dataclass

from firmware_bridge.drivers.polled import LineDriver
from firmware_bridge.drivers.polled.options import (
    INT32,
    PolledOptions,
    check_watchdog,
    counts_per_metre,
    servo_position,
)
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import crc16
from firmware_bridge.messages import LinkError
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded

VERSION = 2  # of the protocol; version 1 knew two motors and no servo
DRIVEN, WATCHDOG, STOPPED, ENCODER, FAULT = 1, 2, 4, 8, 16
"""Flags of a state: motors driven, watchdog expired, stop input, encoder fault, other fault."""
ERRORS = {
    STOPPED: "stop input pressed",
    ENCODER: "encoder fault",
    FAULT: "the sketch reports a fault",
}
SEQUENCES = 256
LINE = re.compile(rb"([HS]) (\d{1,3})((?: -?\d{1,10})*)\*([0-9A-F]{4})")


def line(text: str) -> bytes:
    r"""Build a line: text, `*`, CRC-16/XMODEM of the text as four hexadecimal digits, line feed.

    Examples
    --------
    >>> line("P 7")
    b'P 7*1E9C\n'
    """
    body = text.encode("ascii")
    return body + b"*%04X\n" % crc16(body)


@dataclass(frozen=True, kw_only=True)
class ArduinoOptions(PolledOptions):
    """The ``[board]`` section of a robot file."""

    counts_per_turn: float = bounded(1.0, 1e7)
    """Encoder counts per motor turn, as the sketch counts them."""
    watchdog: float = bounded(0.1, 10.0, "s", 0.3)
    """The board stops the motors when it hears no command for this time [s]; part of each command.
    """
    servo_straight: float = bounded(500.0, 2500.0, "us", 1500.0)
    """Pulse with which a car's servo steers straight [us] ..."""
    servo_left: float = bounded(500.0, 2500.0, "us", 1900.0)
    """... and with which it steers left as far as it goes."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_watchdog(self.command_timeout, self.watchdog)


class ArduinoDriver(LineDriver):
    """Motors on a microcontroller, and perhaps a car's servo.

    `V` commands speeds, `P` asks for the state, `R` lets go, `H` asks for identity. `V`, `P` and
    `R` are all answered by a state with the number of the request, so that a late answer is never
    taken for another. The watchdog's time is part of every command: a board that was reset has
    nothing to lose.
    """

    board = "Arduino"
    options_type = ArduinoOptions

    def __init__(self, transport: Transport, geometry: Geometry, options: ArduinoOptions) -> None:
        odometry = WheelOdometry(geometry, options.counts_per_turn, wraps=True)
        super().__init__(transport, geometry, odometry, options)
        counts_per_metre(geometry, options.counts_per_turn)
        self._counts_per_turn, self._options = options.counts_per_turn, options
        self._numbers = 2 + 2 * len(geometry.names)
        self._watchdog = round(options.watchdog * 1000.0)
        self._sequence, self._uptime = 0, -1
        self.hint = "is it powered, wired TX to RX, with the sketch loaded, at this baud rate?"

    def _configure(self) -> None:
        self._transport.write(b"\n")  # ends whatever half a line the board has
        (version, *made), _ = self._request("H", "", 1)
        if not 1 <= version <= VERSION:
            raise LinkError(
                f"the sketch speaks version {version} of the protocol, expected {VERSION}"
            )
        motors, servos = (*made, 2, 0)[:2] if version > 1 else (2, 0)
        wanted = len(self._geometry.names), int(self._steering is not None)
        if (motors, servos) != wanted:
            raise LinkError(
                f"the sketch has {motors} motors and {servos} servos, expected {wanted[0]} and "
                f"{wanted[1]}: KMPC_MOTORS and KMPC_SERVO in kmpc_wheels.ino"
            )
        self._uptime = -1
        self._drive(*self._geometry.still)

    def _poll(self, cycle: int) -> None:
        self._take(*self._request("P", "", self._numbers))

    def _drive(self, *turns: float) -> None:
        words = [round(turn * self._counts_per_turn) for turn in turns]
        if self._steering is not None:
            words.append(round(servo_position(self._options, self._steering.share)))
        self._request("V", "".join(f" {w}" for w in (*words, self._watchdog)), self._numbers)

    def _release(self) -> None:
        self._request("R", "", self._numbers)

    def _take(self, values: list[int], stamp: float) -> None:
        """Take a state: uptime [ms], counters, speeds [counts/s], flags."""
        uptime, *moved, flags = values[: self._numbers]
        counts, speeds = moved[: len(moved) // 2], moved[len(moved) // 2 :]
        before, self._uptime = self._uptime, uptime
        if (
            uptime < before and before - uptime < INT32
        ):  # else the 32 bits of milliseconds have wrapped
            self._restarted()
            return
        self._errors = tuple(word for bit, word in ERRORS.items() if flags & bit)
        self._warnings = ("watchdog expired",) if flags & WATCHDOG else ()
        self._estimate_ok = not flags & ENCODER
        scale = self._counts_per_turn
        self._moved(tuple(counts), tuple(speed / scale for speed in speeds), stamp)

    def _request(self, kind: str, arguments: str, count: int) -> tuple[list[int], float]:
        """Ask, and return the numbers of the answer, whose count is checked."""
        self._sequence = (self._sequence + 1) % SEQUENCES
        key = ("H" if kind == "H" else "S", self._sequence)
        reply, stamp = self._exchange.ask(line(f"{kind} {self._sequence}{arguments}"), key)
        values = [int(word) for word in reply.split()]
        if len(values) < count:
            raise self._exchange.refuse(f"{kind}: expected {count} numbers, got {len(values)}")
        return values, stamp

    def _take_line(self, line: bytes, stamp: float) -> bool:
        match = LINE.fullmatch(line)
        if match is None or int(match[4], 16) != crc16(line[:-5]):
            return False
        self._exchange.deliver((match[1].decode("ascii"), int(match[2])), match[3], stamp)
        return True
