"""An ESP32 or Arduino with the sketch of examples/kmpc_wheels: our line protocol, its watchdog."""

from __future__ import annotations

import re
from typing import Unpack

from firmware_bridge.drivers.arduino import DRIVEN, VERSION, WATCHDOG, ArduinoOptions, line
from firmware_bridge.kinematics import CarGeometry, Geometry
from firmware_bridge.link.framing import crc16
from firmware_bridge.odometry import wrapped
from kmpc_lab.emulator.board import BoardEmulator, Scene

LONGEST_LINE, A_NUMBER = 24, 12
"""Bytes of a request without its line feed: beside the numbers of motors and servo, and of one."""
NUMBER = re.compile(r"-?\d{1,10}")
INT32 = 2**31
LONGEST_WATCHDOG = 60000  # [ms]


class ArduinoEmulator(BoardEmulator):
    """A microcontroller with a robot under it.

    Geometry and options are the robot's, as for the driver.
    """

    boot_text = b"\x00ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET)\r\n"
    options_type = ArduinoOptions

    def __init__(
        self, geometry: Geometry, options: ArduinoOptions, **around: Unpack[Scene]
    ) -> None:
        super().__init__(geometry, **around)
        self._counts_per_turn, self._options = options.counts_per_turn, options
        self._motors, self._servos = len(geometry.names), int(isinstance(geometry, CarGeometry))
        self._buffer = bytearray()
        self._dropping = False
        self._let_go_all()
        self._reset()

    def _reset(self) -> None:
        self.faults = 0  # bits of STOPPED, ENCODER, FAULT; set them to see what the other end does
        self._booted = self._clock()
        self._heard = self._watchdog_ms = 0
        self._driven = self._expired = False

    def _watchdog(self, now: float) -> None:
        if self._driven and self._uptime(now) - self._heard > self._watchdog_ms:
            self._driven, self._expired = False, True
        if self.faults or not self._driven:
            self._let_go_all()

    def _answer(self, data: bytes, now: float) -> bytes:
        out = b""
        for byte in data:
            if byte in b"\r\n":
                whole = bytes(self._buffer)
                if whole and not self._dropping:
                    out += self._execute(whole, now)
                self._buffer.clear()
                self._dropping = False
            elif len(self._buffer) < self._longest and not self._dropping:
                self._buffer.append(byte)
            else:
                self._dropping = True
        return out

    @property
    def _longest(self) -> int:
        return LONGEST_LINE + A_NUMBER * (self._motors + self._servos)

    def _execute(self, request: bytes, now: float) -> bytes:
        body, star, check = request.rpartition(b"*")
        if not star or not re.fullmatch(rb"[0-9A-F]{4}", check) or int(check, 16) != crc16(body):
            return b""
        kind, *words = body.decode("latin-1").split(" ")
        if not words or not all(NUMBER.fullmatch(word) for word in words):
            return b""
        sequence, *values = (int(word) for word in words)
        if not 0 <= sequence <= 255 or any(not -INT32 <= value < INT32 for value in values):
            return b""
        if kind == "H" and not values:
            return line(f"H {sequence} {VERSION} {self._motors} {self._servos}")
        if kind == "V" and self._is_drive(values):
            self._heard, self._watchdog_ms = self._uptime(now), values[-1]
            self._driven, self._expired = True, False
            for channel in range(self._motors):
                self._set(channel, values[channel] / self._counts_per_turn)
            if self._servos:
                straight, left = self._options.servo_straight, self._options.servo_left
                self._body.steered = min(max((values[-2] - straight) / (left - straight), -1), 1)
        elif kind == "R" and not values:
            self._driven = False
        elif kind != "P" or values:
            return b""
        self._watchdog(now)
        return line(f"S {sequence} {self._state(now)}")

    def _is_drive(self, values: list[int]) -> bool:
        if len(values) != self._motors + self._servos + 1:
            return False
        pulses = values[self._motors : -1]
        return 0 < values[-1] <= LONGEST_WATCHDOG and all(500 <= p <= 2500 for p in pulses)

    def _uptime(self, now: float) -> int:
        """Milliseconds since the start."""
        return round((now - self._booted) * 1000.0)

    def _state(self, now: float) -> str:
        motors = range(self._motors)
        counts = [int(wrapped(round(self._turns(i) * self._counts_per_turn))) for i in motors]
        speeds = [round(self._body.speeds[i] * self._counts_per_turn) for i in motors]
        flags = self.faults | DRIVEN * self._driven | WATCHDOG * self._expired
        return " ".join(map(str, (self._uptime(now) % 2**32, *counts, *speeds, flags)))
