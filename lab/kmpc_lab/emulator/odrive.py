"""An ODrive with two axes: ASCII lines, checksums, and axis watchdogs that disarm.

The estimate of an axis may be invalid.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Unpack

from firmware_bridge.drivers.odrive import CLOSED_LOOP, IDLE, REGISTERS, ODriveOptions
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link.framing import Lines, odrive_text, xor8
from kmpc_lab.emulator.board import BoardEmulator, Scene

INVALID_STATE = 0x1
PROPERTY = re.compile(
    r"axis([01])\.(error|active_errors|current_state|requested_state|config\.enable_watchdog|config\.watchdog_timeout)"
)


@dataclass
class Axis:
    """Registers of one axis."""

    errors: int = 0
    state: int = IDLE
    enable_watchdog: bool = False
    watchdog_timeout: float = 0.0
    fed: float = -math.inf
    calibrated: bool = True


class ODriveEmulator(BoardEmulator):
    """An ODrive with a robot under it.

    `geometry`, `options`: of the robot, as for the driver. `firmware`: "0.5" (errors in
    `axisN.error`) or "0.6" (`axisN.active_errors`). `**around`: see `Scene`.
    """

    boot_text = b"ODrive booting\r\n* clocks ok *12\r\n"
    options_type = ODriveOptions

    def __init__(
        self,
        geometry: Geometry,
        options: ODriveOptions | None = None,
        firmware: str = "0.5",
        **around: Unpack[Scene],
    ) -> None:
        super().__init__(geometry, **around)
        options = options or ODriveOptions()
        self._register = REGISTERS[0 if firmware == "0.5" else 1]
        self._channel = {options.first_axis: 0, options.second_axis: 1}
        self._lines = Lines()
        self.line_end = b"\r\n"  # behind a checksum; firmware before 0.5.3 sends none
        self.axes = (Axis(), Axis())
        """Registers of axes 0 and 1; set errors to see what the other end does."""
        self._let_go_all()

    def _reset(self) -> None:
        self.axes = (Axis(), Axis())

    def _watchdog(self, now: float) -> None:
        for number, axis in enumerate(self.axes):
            if axis.enable_watchdog and now - axis.fed > axis.watchdog_timeout:
                axis.errors |= self._register.watchdog
            if axis.errors:
                self._disarm(number)

    def _disarm(self, number: int) -> None:
        self.axes[number].state = IDLE
        self._let_go(self._channel.get(number, number))

    def _answer(self, data: bytes, now: float) -> bytes:
        out = b""
        for line in self._lines.feed(data.replace(b"!", b"\n")):
            line = line.partition(b";")[0]
            text = odrive_text(line, checksum=False)
            if text is None:
                continue  # a wrong checksum is passed over without a word
            reply = self._execute(text, now)
            if reply is not None:
                body = reply.encode("ascii")
                out += body + (b"*%d" % xor8(body) + self.line_end if b"*" in line else b"\r\n")
        return out

    def _execute(self, text: str, now: float) -> str | None:
        command, *words = text.split()
        if command in ("r", "w"):
            match = PROPERTY.fullmatch(words[0]) if words else None
            if match is None:
                return "invalid property" if words else "invalid command format"
            if match[2] in ("error", "active_errors") and match[2] != self._register.name:
                return "invalid property"
            number = int(match[1])
            return (
                self._get(number, match[2])
                if command == "r"
                else self._put(number, match[2], words[1:], now)
            )
        if command == "sc":
            for axis in self.axes:
                axis.errors = 0
            return None
        if command == "sr":
            self._let_go_all()
            self._zero = list(self._body.turns)
            self._reset()
            return None
        if command not in ("v", "u", "f"):
            return "unknown command"
        return self._axis_command(command, words, now)

    def _axis_command(self, command: str, words: list[str], now: float) -> str | None:
        try:
            number, values = int(words[0]), [float(word) for word in words[1:]]
        except (ValueError, IndexError):
            return "invalid command format"
        if not all(map(math.isfinite, values)):
            return "invalid command format"
        if number not in (0, 1):
            return f"invalid motor {number}"
        axis, channel = self.axes[number], self._channel.get(number, number)
        if command == "f":
            valid = axis.calibrated and not axis.errors & self._register.estimate
            return (
                f"{self._turns(channel):f} {self._body.speeds[channel]:f}"
                if valid
                else "0.000000 0.000000"
            )
        if command == "v":
            if not values:
                return "invalid command format"
            if axis.state == CLOSED_LOOP:
                self._set(channel, values[0])
        axis.fed = now
        return None

    def _get(self, number: int, name: str) -> str:
        axis = self.axes[number]
        if name == "config.enable_watchdog":
            return str(int(axis.enable_watchdog))
        if name == "config.watchdog_timeout":
            return f"{axis.watchdog_timeout:f}"
        return str(axis.errors if name in ("error", "active_errors") else axis.state)

    def _put(self, number: int, name: str, words: list[str], now: float) -> str | None:
        axis = self.axes[number]
        try:
            value = float(words[0])
        except (ValueError, IndexError):
            return "not implemented"
        if not math.isfinite(value):
            return "not implemented"
        if name == "config.enable_watchdog":
            axis.enable_watchdog = bool(value)
        elif name == "config.watchdog_timeout":
            axis.watchdog_timeout, axis.fed = value, now
        elif name == "requested_state":
            self._request(number, int(value))
        elif name == "error":
            axis.errors = int(value)
        else:
            return "not implemented"
        self._watchdog(now)
        return None

    def _request(self, number: int, state: int) -> None:
        axis = self.axes[number]
        if state == IDLE:
            self._disarm(number)
        elif state == CLOSED_LOOP and axis.calibrated and not axis.errors:
            axis.state = CLOSED_LOOP
            self._set(self._channel.get(number, number), 0.0)
        else:
            axis.errors |= INVALID_STATE
