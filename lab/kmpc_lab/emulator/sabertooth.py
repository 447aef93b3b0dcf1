"""A Sabertooth, or two SyRens: packet serial, bauding character, time-out; answers nothing."""

from __future__ import annotations

import math
from typing import Unpack

from firmware_bridge.drivers.sabertooth import FULL, TIMEOUT, TIMEOUT_UNIT, SabertoothOptions
from firmware_bridge.kinematics import Geometry
from kmpc_lab.emulator.board import BoardEmulator, Scene

BAUDING = 0xAA


class SabertoothEmulator(BoardEmulator):
    """A Sabertooth with a robot under it.

    Geometry and options are the robot's, as for the driver.
    """

    options_type = SabertoothOptions

    def __init__(
        self, geometry: Geometry, options: SabertoothOptions, **around: Unpack[Scene]
    ) -> None:
        super().__init__(geometry, **around)
        wheel = options.full_speed / geometry.wheel_radius
        self._full = wheel * geometry.gear_ratio / math.tau
        self._addresses = (options.address, options.second_address)
        self._reset()

    def _reset(self) -> None:
        self.timeout = 0.0  # serial time-out [s], 0 for none
        self.bauded = False  # whether the bauding character has come since the start
        self.bad = 0  # bytes skipped as part of no packet
        self._heard = -math.inf
        self._buffer = bytearray()

    def _watchdog(self, now: float) -> None:
        if self.timeout and now - self._heard > self.timeout:
            self._body.command = [0.0, 0.0]

    def _answer(self, data: bytes, now: float) -> bytes:
        self._buffer += data
        at = 0
        while at < len(self._buffer):
            if self._buffer[at] == BAUDING:
                self.bauded, at = True, at + 1
            elif self._buffer[at] < 128:
                self.bad, at = self.bad + 1, at + 1
            elif at + 4 > len(self._buffer):
                break
            else:
                address, command, value, check = self._buffer[at : at + 4]
                good = self.bauded and check == (address + command + value) & 0x7F
                if good and command < 128 and value < 128:
                    self._execute(address, command, value, now)
                    at += 4
                else:
                    self.bad, at = self.bad + 1, at + 1
        del self._buffer[:at]
        return b""

    def _execute(self, address: int, command: int, value: int, now: float) -> None:
        if address not in self._addresses:
            return
        self._heard = now
        if command == TIMEOUT:
            self.timeout = value * TIMEOUT_UNIT
        elif command in (0, 1, 4, 5):
            motor = 1 if command >= 4 or address == self._addresses[1] else 0
            sign = -1.0 if command in (1, 5) else 1.0
            self._set(motor, sign * self._full * value / FULL)
