"""Error registers of ODrive axes, by firmware, and what their bits mean."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass

from firmware_bridge.drivers.polled import LineDriver, NoReply
from firmware_bridge.drivers.polled.options import PolledOptions, check_watchdog
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import odrive_line, odrive_text
from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded

AXIS_ERRORS = {
    0x1: "invalid state",
    0x40: "motor failed",
    0x80: "sensorless estimator failed",
    0x100: "encoder failed",
    0x200: "controller failed",
    0x800: "watchdog timer expired",
    0x1000: "min endstop pressed",
    0x2000: "max endstop pressed",
    0x4000: "e-stop requested",
    0x20000: "homing without endstop",
    0x40000: "over-temperature",
    0x80000: "unknown position",
}
"""Bits of `axisN.error`, firmware 0.5."""
ACTIVE_ERRORS = {
    0x1: "initializing",
    0x2: "system level",
    0x4: "timing error",
    0x8: "missing estimate",
    0x10: "bad configuration",
    0x20: "gate driver fault",
    0x40: "missing input",
    0x100: "DC bus over-voltage",
    0x200: "DC bus under-voltage",
    0x400: "DC bus over-current",
    0x800: "DC bus over-regeneration",
    0x1000: "current limit",
    0x2000: "motor over-temperature",
    0x4000: "inverter over-temperature",
    0x8000: "velocity limit",
    0x10000: "position limit",
    0x1000000: "watchdog timer expired",
    0x2000000: "e-stop requested",
    0x4000000: "spinout",
    0x8000000: "brake resistor disarmed",
    0x10000000: "thermistor disconnected",
    0x40000000: "calibration error",
}
"""Bits of `axisN.active_errors`, firmware 0.6."""
IDLE, CLOSED_LOOP = 1, 8
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)", re.ASCII)
BOOLEANS = {"True": "1", "False": "0"}
"""Words that an ODrive answers with, as the numbers that they count as."""
REFUSALS = ("invalid property", "unknown command", "not implemented", "invalid command format")


@dataclass(frozen=True)
class ErrorRegister:
    """Where a firmware keeps the errors of an axis, and what they mean."""

    name: str
    words: Mapping[int, str]
    watchdog: int
    estimate: int  # errors under which position and speed mean nothing

    def text(self, errors: int) -> tuple[str, ...]:
        """Say which errors stand."""
        return tuple(
            self.words.get(1 << bit, f"error bit {bit}")
            for bit in range(errors.bit_length())
            if errors >> bit & 1
        )


REGISTERS = (
    ErrorRegister("error", AXIS_ERRORS, 0x800, 0x80 | 0x100 | 0x80000),
    ErrorRegister("active_errors", ACTIVE_ERRORS, 0x1000000, 0x1 | 0x2 | 0x8 | 0x40000000),
)


@dataclass(frozen=True, kw_only=True)
class ODriveOptions(PolledOptions):
    """The ``[board]`` section of a robot file."""

    first_axis: int = bounded(0, 7, "", 0)
    second_axis: int = bounded(0, 7, "", 1)
    watchdog: float = bounded(0.1, 10.0, "s", 0.5)
    """An axis disarms when it hears no command for so long [s]."""
    checksum: bool = True  # add an XOR to every line, and want one back; lines without are refused
    clear_errors: bool = False  # clear any standing error on connect; else only an expired watchdog
    command_timeout: float = bounded(0.05, 10.0, "s", 0.25)
    """The driver sends zero when the last command is older [s]; less than the watchdog, so that the
    motors brake before they disarm."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.first_axis == self.second_axis:
            raise ConfigError(
                "second_axis: expected another axis than first_axis, "
                f"got {self.second_axis} for both"
            )
        check_watchdog(self.command_timeout, self.watchdog)


class ODriveDriver(LineDriver):
    """Two axes of one ODrive over its ASCII protocol.

    `v` commands, `f` gives feedback, `r` and `w` read and write errors, state and watchdog.

    Replies carry no name. Requests for two numbers and for one number alternate, and the link keeps
    their order, so a reply that comes too late has the wrong shape for the request that waits, and
    is refused.
    """

    board = "ODrive"
    options_type = ODriveOptions
    answers_commands = False

    def __init__(
        self, transport: Transport, geometry: Geometry, options: ODriveOptions | None = None
    ) -> None:
        options = options or ODriveOptions()
        odometry = WheelOdometry(geometry, 1.0, wraps=False)
        super().__init__(transport, geometry, odometry, options)
        self._axes, self._options = (options.first_axis, options.second_axis), options
        self._register = REGISTERS[0]
        self._armed = False
        self._axis_errors = [0, 0]
        self._fed = -math.inf
        self.hint = (
            "is it powered, wired TX to RX, with its UART or USB in ASCII mode at this baud rate?"
        )

    def _configure(self) -> None:
        """Find the error register; `_arm` does the rest."""
        self._armed = False
        self._ask(
            odrive_line(f"f {self._axes[0]}", self._options.checksum), "pair"
        )  # behind it, no number is late
        self._find_register()

    def _arm(self) -> None:
        """Clear an expired watchdog, set the watchdogs, close the loop at zero speed."""
        self._drive(*self._geometry.still)
        self._clear()
        for axis in self._axes:
            setting = f"w axis{axis}.config.watchdog_timeout {self._options.watchdog:.6f}"
            self._say(setting, f"u {axis}", f"w axis{axis}.config.enable_watchdog 1")
        for axis in self._axes:
            timeout = self._number(f"axis{axis}.config.watchdog_timeout")
            if abs(timeout - self._options.watchdog) > 1e-3 or not self._watchdog_is_set(axis):
                raise LinkError(
                    f"axis {axis} did not take a watchdog of {self._options.watchdog:g} s"
                )
        for axis in self._axes:  # only now: no axis turns without its watchdog
            self._say(f"u {axis}", f"w axis{axis}.requested_state {CLOSED_LOOP}", f"v {axis} 0 0")
        end = time.monotonic() + 0.5
        while not self._closed_loop():
            self._drive(*self._geometry.still)
            self._read_errors()
            if any(self._axis_errors) or time.monotonic() > end:
                raise LinkError(
                    "; ".join(self._errors)
                    or (
                        "the axes do not enter closed-loop control: "
                        "are motor and encoder calibrated?"
                    )
                )
        self._armed = True

    def _find_register(self) -> None:
        for register in REGISTERS:
            self._register = register
            try:
                self._number(f"axis{self._axes[0]}.{register.name}")
                return
            except NoReply:
                self._settle()
        raise NoReply

    def _clear(self) -> None:
        """Clear the expired watchdog that a dead process leaves; others only if configured."""
        self._read_errors()
        others = [errors & ~self._register.watchdog for errors in self._axis_errors]
        if any(others) and not self._options.clear_errors:
            raise LinkError("; ".join(self._errors))
        if any(self._axis_errors):
            self._say(
                *(f"u {axis}" for axis in self._axes), "sc", *(f"u {axis}" for axis in self._axes)
            )
            self._read_errors()

    def _poll(self, cycle: int) -> None:
        self._feed_idle()
        feedback: list[tuple[float, float, float]] = []
        for i, axis in enumerate(self._axes):
            line, stamp = self._ask(odrive_line(f"f {axis}", self._options.checksum), "pair")
            self._axis_errors[i] = self._error_of(axis)
            position, speed = map(float, line.split())
            feedback.append((position, speed, stamp))
        self._judge(feedback)
        if cycle % 5 == 0:
            self._look_at_loops()
        if self._released and self._mode != "idle":
            self._release()
        if cycle % 25 == 12 and self._armed and not all(map(self._watchdog_is_set, self._axes)):
            self._restarted()

    def _look_at_loops(self) -> None:
        """See whether the axes still drive: one that let go without an error was restarted."""
        closed = self._closed_loop()
        lost = self._armed and not closed and not self._released and not any(self._axis_errors)
        self._armed = closed and self._armed and not any(self._axis_errors)
        if lost and not all(map(self._watchdog_is_set, self._axes)):
            self._restarted()

    def _judge(self, feedback: list[tuple[float, float, float]]) -> None:
        """Use positions and speeds only where the errors say that they mean something."""
        self._tell_errors()
        if any(self._axis_errors):
            self._armed = False
        invalid = False
        for (position, speed, _), errors in zip(feedback, self._axis_errors, strict=True):
            zeros = position == 0.0 and speed == 0.0 and errors & ~self._register.watchdog
            invalid |= bool(errors & self._register.estimate or zeros)
        self._estimate_ok = not invalid
        if not invalid:
            (first, speed1, stamp1), (second, speed2, stamp2) = feedback
            self._moved((first + speed1 * (stamp2 - stamp1), second), (speed1, speed2), stamp2)

    def _barrier(self) -> None:
        self._number(f"axis{self._axes[0]}.current_state")

    def _feed_idle(self) -> None:
        """Feed the watchdogs with zeros, and with nothing else, without commands."""
        with self._changed:
            idle = not any(self._held.value) and not self._released
        if idle and time.monotonic() - self._fed > self._options.watchdog / 4.0:
            self._drive(*self._geometry.still)

    def _read_errors(self) -> None:
        self._axis_errors = [self._error_of(axis) for axis in self._axes]
        self._tell_errors()

    def _tell_errors(self) -> None:
        pairs = zip(self._axes, self._axis_errors, strict=True)
        self._errors = tuple(
            f"axis {axis}: {word}" for axis, errors in pairs for word in self._register.text(errors)
        )

    def _error_of(self, axis: int) -> int:
        errors = self._number(f"axis{axis}.{self._register.name}")
        if not 0 <= errors < 2**64 or errors != int(errors):
            raise self._exchange.refuse(f"error register {errors}")
        return int(errors)

    def _closed_loop(self) -> bool:
        states = [self._number(f"axis{axis}.current_state") for axis in self._axes]
        self._mode = {IDLE: "idle", CLOSED_LOOP: "closed loop"}.get(
            int(min(states)), f"state {min(states):g}"
        )
        return all(state == CLOSED_LOOP for state in states)

    def _watchdog_is_set(self, axis: int) -> bool:
        return self._number(f"axis{axis}.config.enable_watchdog") == 1.0

    def _drive(self, *speeds: float) -> None:
        first, second = speeds
        self._say(f"v {self._axes[0]} {first:.6f} 0", f"v {self._axes[1]} {second:.6f} 0")
        self._fed = time.monotonic()

    def _release(self) -> None:
        for axis in self._axes:
            self._say(
                f"w axis{axis}.requested_state {IDLE}", f"w axis{axis}.config.enable_watchdog 0"
            )
        self._armed = False

    def _say(self, *lines: str) -> None:
        """Send lines that are not answered, as one frame."""
        self._transport.write(b"".join(odrive_line(line, self._options.checksum) for line in lines))

    def _number(self, name: str) -> float:
        line, _ = self._ask(odrive_line(f"r {name}", self._options.checksum), "number")
        if not NUMBER.fullmatch(line.decode("ascii")) or not math.isfinite(float(line)):
            raise self._exchange.refuse(line.decode("ascii"))
        return float(line)

    def _take_line(self, line: bytes, stamp: float) -> bool:
        text = odrive_text(line, self._options.checksum)
        if text is None:
            return False
        words = [BOOLEANS.get(word, word) for word in text.split()]
        shape = None
        if text in REFUSALS:
            shape = "number"
        elif all(NUMBER.fullmatch(word) for word in words):
            shape = {1: "number", 2: "pair"}.get(len(words))
        self._exchange.deliver(shape, " ".join(words).encode("ascii"), stamp)
        return True
