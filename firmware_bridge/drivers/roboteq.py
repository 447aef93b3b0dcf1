"""Roboteq over its serial commands (Advanced Digital Motor Controllers User Manual, Roboteq)."""

from __future__ import annotations

import re
from collections.abc import Hashable
from dataclasses import dataclass

from firmware_bridge.drivers.polled import LineDriver
from firmware_bridge.drivers.polled.options import PolledOptions, check_watchdog
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded

FAULTS = (
    "overheat",
    "over-voltage",
    "under-voltage",
    "short circuit",
    "emergency stop",
    "motor or sensor set-up fault",
    "MOSFET failure",
    "default configuration loaded at start-up",
)
"""Bits of `?FF`."""
LOOP_ERROR = 0x04
MOTOR_FLAGS = (
    "amps limit",
    "motor stalled",
    "loop error",
    "safety stop",
    "forward limit",
    "reverse limit",
    "amps trigger",
)
"""Bits of `?FM`, a number a channel."""
CLOSED_LOOP_SPEED = (1, 6)  # values of MMOD in which `!S` sets a speed
REPLY = re.compile(rb"([A-Z]{1,5})=(-?\d{1,10}(?::-?\d{1,10})*)")
ACCEPTED, REFUSED = b"+", b"-"
BOTH = "both accepted"
REFUSALS = 5  # number of consecutive refused commands that is reported
RPM = 60.0


@dataclass(frozen=True, kw_only=True)
class RoboteqOptions(PolledOptions):
    """The ``[board]`` section of a robot file."""

    counts_per_turn: float = bounded(1.0, 1e7)
    """Encoder counts per motor turn: four times the encoder's pulses (`EPPR`)."""
    watchdog: float = bounded(0.1, 10.0, "s", 0.5)
    """The board stops the motors when it hears no command for so long (`RWD`) [s]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_watchdog(self.command_timeout, self.watchdog)


class RoboteqDriver(LineDriver):
    """Two motors in closed-loop speed mode.

    Speeds by `!S`, counters by `?C`, speeds by `?S`, faults by `?FF` and `?FM`. Only commands feed
    the board's watchdog, and the first command after it has tripped lets *both* motors go on at
    their old speed: both are therefore always commanded in one frame.
    """

    board = "Roboteq"
    options_type = RoboteqOptions

    def __init__(self, transport: Transport, geometry: Geometry, options: RoboteqOptions) -> None:
        odometry = WheelOdometry(geometry, options.counts_per_turn, wraps=True)
        super().__init__(transport, geometry, odometry, options)
        self._counts_per_turn = options.counts_per_turn
        self._watchdog = round(options.watchdog * 1000.0)
        self._accepted = self._refusals = 0
        self.hint = "is it powered, wired TX to RX, with serial commands enabled at this baud rate?"

    def _configure(self) -> None:
        """Stop the echo and the motors, set the watchdog, and see that `!S` means a speed."""
        self._transport.write(b"^ECHOF 1\r")
        self._settle()
        modes = self._numbers("~MMOD", "MMOD")[0]
        if not all(mode in CLOSED_LOOP_SPEED for mode in modes):
            raise LinkError(
                f"the motors are in mode {' and '.join(f'{mode:.0f}' for mode in modes)}, "
                "expected closed-loop speed: ^MMOD 1 1 and ^MMOD 2 1"
            )
        self._drive(*self._geometry.still)
        self._transport.write(b"^RWD %d\r" % self._watchdog)
        self._settle()
        if not self._watchdog_is_set():
            raise LinkError(f"the board did not take a watchdog of {self._watchdog} ms")

    def _poll(self, cycle: int) -> None:
        counts, stamp = self._pair("?C", "C")
        speeds, _ = self._pair("?S", "S")
        self._moved(counts, (speeds[0] / RPM, speeds[1] / RPM), stamp)
        if cycle % 5 == 0:
            self._read_faults()
        if cycle % 25 == 12 and not self._watchdog_is_set():
            self._restarted()

    def _read_faults(self) -> None:
        faults = int(self._numbers("?FF", "FF")[0][0])
        flags = [int(flag) for flag in self._numbers("?FM", "FM")[0]]
        errors = _words(FAULTS, faults)
        warnings: list[str] = []
        for motor, flag in enumerate(flags, start=1):
            for bit, word in _bits(MOTOR_FLAGS, flag):
                (errors if bit & LOOP_ERROR else warnings).append(f"motor {motor}: {word}")
        self._errors, self._warnings = tuple(errors), tuple(warnings)
        self._estimate_ok = not any(flag & LOOP_ERROR for flag in flags)

    def _barrier(self) -> None:
        self._numbers("~RWD", "RWD")

    def _watchdog_is_set(self) -> bool:
        return self._numbers("~RWD", "RWD")[0] == [self._watchdog]

    def _drive(self, *speeds: float) -> None:
        first, second = speeds
        frame = b"!S 1 %d\r!S 2 %d\r" % (round(first * RPM), round(second * RPM))
        self._exchange.ask(frame, BOTH)

    def _release(self) -> None:
        self._exchange.ask(b"!MS 1\r!MS 2\r", BOTH)

    def _pair(self, question: str, name: str) -> tuple[tuple[float, float], float]:
        values, stamp = self._numbers(question, name)
        if len(values) != 2:
            raise self._exchange.refuse(f"{name}: expected 2 channels, got {len(values)}")
        return (values[0], values[1]), stamp

    def _numbers(self, question: str, name: str) -> tuple[list[float], float]:
        reply, stamp = self._ask(question.encode("ascii") + b"\r", name)
        return [float(word) for word in reply.split(b":")], stamp

    def _begin(self, key: Hashable) -> None:
        super()._begin(key)
        self._accepted = 0

    def _take_line(self, line: bytes, stamp: float) -> bool:
        match = REPLY.fullmatch(line)
        if match is not None:
            self._exchange.deliver(match[1].decode("ascii"), match[2], stamp)
            return True
        if line in (ACCEPTED, REFUSED):
            self._answered(line == ACCEPTED, stamp)
            return True
        return line[:1] in b"^!~?"  # an echo of ours, before it is switched off

    def _answered(self, accepted: bool, stamp: float) -> None:
        """Count the answers to the two commands of a frame."""
        if self._exchange.expected != BOTH:
            return
        self._accepted += accepted
        if (
            not accepted
        ):  # a damaged line is refused too, and repeated: only many in a row are reported
            self._refusals += 1
            if self._refusals >= REFUSALS:
                self._trouble = ("the board refuses commands",)
        elif self._accepted == 2:
            if self._refusals >= REFUSALS:
                self._trouble = ()
            self._refusals = 0
            self._exchange.deliver(BOTH, b"", stamp)


def _bits(words: tuple[str, ...], flags: int) -> list[tuple[int, str]]:
    """Bits that stand, with their words."""
    return [
        (1 << bit, words[bit] if bit < len(words) else f"bit {bit}")
        for bit in range(max(0, flags).bit_length())
        if flags >> bit & 1
    ]


def _words(words: tuple[str, ...], flags: int) -> list[str]:
    return [word for _, word in _bits(words, flags)]
