"""A microcontroller that drives by itself, as far as speeds go: no controller is in the emulator.

`examples/firmware` in QEMU is the real program.
"""

from __future__ import annotations

import math
import struct
from typing import Unpack

from firmware_bridge.drivers.onboard import (
    ABOUT,
    ESTOPPED,
    NO_POSE,
    STATE,
    VERSION,
    Kind,
    OnboardOptions,
    decoder,
    message,
)
from firmware_bridge.kinematics import Geometry
from kmpc_lab.emulator.board import BoardEmulator, Scene

LASTS = 0.25  # how long speeds hold, since they were asked and since they came [s]
AHEAD = 0.05  # what seems to be of a later time by more is not believed [s]
DRIVES, NO_GOAL, SOLVED, STOPPED = 0, 1, 0, 3


class OnboardEmulator(BoardEmulator):
    """The board's side of the messages, with a robot under it.

    Telemetry follows each heartbeat. Goals, paths and models are heard, and nothing comes of them.

    Geometry and options are the robot's, as for the driver.
    """

    options_type = OnboardOptions

    def __init__(
        self, geometry: Geometry, options: OnboardOptions, **around: Unpack[Scene]
    ) -> None:
        super().__init__(geometry, **around)
        self._reset()

    def _reset(self) -> None:
        self.estopped = False
        self._frames = decoder()
        self._good = self._beat = 0
        self._booted = self._clock()
        self._asked, self._heard = -math.inf, -math.inf
        self._speeds = (0.0, 0.0)

    def _watchdog(self, now: float) -> None:
        age = now - self._asked
        if self.estopped or not -AHEAD <= age <= LASTS or now - self._heard > LASTS:
            self._speeds = (0.0, 0.0)
        channels = self._geometry.to_channels(*self._geometry.wheels(*self._speeds))
        for channel, turns in enumerate(channels):
            self._set(channel, turns)

    def _answer(self, data: bytes, now: float) -> bytes:
        out = b""
        for body in self._frames.feed(data):
            if len(body) >= 2 and body[0] == VERSION:
                self._good += 1
                out += self._execute(body[1], body[2:], now)
        self._watchdog(now)
        return out

    def _execute(self, kind: int, payload: bytes, now: float) -> bytes:
        if kind == Kind.HEARTBEAT and len(payload) == 4:
            self._beat = int.from_bytes(payload, "little")
            return self._telemetry(now)
        if kind == Kind.ASK:
            return message(Kind.ABOUT, ABOUT.pack(20, 0, 24, 64, 0.1, 0.15, -1, 1, -2, 2))
        if kind == Kind.ESTOP:
            self.estopped = True
        elif kind == Kind.RELEASE:
            self.estopped, self._speeds = False, (0.0, 0.0)
        elif kind == Kind.VELOCITY and len(payload) == 12:
            v, omega, uptime = struct.unpack("<2fI", payload)
            if math.isfinite(v + omega):
                self._speeds, self._heard = (v, omega), now
                self._asked = self._booted + uptime / 1e3
        return b""

    def _telemetry(self, now: float) -> bytes:
        uptime = round(1e3 * (now - self._booted)) & 0xFFFFFFFF
        moves = self._speeds != (0.0, 0.0)
        standing = ESTOPPED if self.estopped else DRIVES if moves else NO_GOAL
        status = SOLVED if moves else STOPPED
        told = (uptime, self._beat, self._good, self._frames.bad, standing, status, 0, 0, NO_POSE)
        return message(Kind.STATE, STATE.pack(*told, *self._speeds, 0.0, 0.0, 0.0))
