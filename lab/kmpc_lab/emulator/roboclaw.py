"""A RoboClaw: packet serial with CRCs, the 10 ms gap, the serial time-out, encoders and status."""

from __future__ import annotations

import math
import struct
from typing import Unpack

from firmware_bridge.drivers.roboclaw import (
    COUNTS,
    DUTY,
    GET_TIMEOUT,
    RAW_SPEEDS,
    SET_TIMEOUT,
    SPEED,
    SPEED_ACCEL,
    STATUS,
    STOPPING_16,
    STOPPING_32,
    RoboClawOptions,
)
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link.framing import ACK, RoboClawPackets, roboclaw_reply
from firmware_bridge.odometry import wrapped
from kmpc_lab.emulator.board import BoardEmulator, Scene

SPEED_M1 = 35
SPEED_M2 = 36
ENCODER_M1 = 16
ENCODER_M2 = 17
SPEED_STATUS_M1 = 18
SPEED_STATUS_M2 = 19
RESET_COUNTS = 20
VERSION = 21
BATTERY = 24
WRITES = {
    SET_TIMEOUT: 1,
    RESET_COUNTS: 0,
    DUTY: 4,
    SPEED_M1: 4,
    SPEED_M2: 4,
    SPEED: 8,
    SPEED_ACCEL: 12,
}
"""Payload sizes."""


class RoboClawEmulator(BoardEmulator):
    """A RoboClaw with a robot under it.

    `geometry`, `options`: of the robot, as for the driver; of the options, address and counts per
    turn count here. `status_bytes`: 2 for old firmware, 4 for new. `**around`: see `Scene`.
    """

    boot_text = b"\x00\xff\x80USB Roboclaw 2x15a v4.2.8\n\x00"
    options_type = RoboClawOptions

    def __init__(
        self,
        geometry: Geometry,
        options: RoboClawOptions,
        status_bytes: int = 4,
        **around: Unpack[Scene],
    ) -> None:
        super().__init__(geometry, **around)
        self._counts_per_turn = options.counts_per_turn
        self._address = options.address
        self._status_bytes = status_bytes
        self._packets = RoboClawPackets(options.address, WRITES)
        self.status = 0  # error and warning bits; set them to see what the other end does
        self.timeout = 0  # serial time-out in units of 0.1 s, 0 for none
        self._heard = -math.inf

    def offset_counts(self, first: int, second: int) -> None:
        """Make the counters read as if they had counted so much more."""
        with self._lock:
            self._zero[0] -= first / self._counts_per_turn
            self._zero[1] -= second / self._counts_per_turn

    def _reset(self) -> None:
        self.timeout, self.status = 0, 0

    def _watchdog(self, now: float) -> None:
        stopping = STOPPING_32 if self._status_bytes == 4 else STOPPING_16
        if self.status & stopping or (self.timeout and now - self._heard > self.timeout / 10.0):
            self._body.command = [0.0, 0.0]

    def _answer(self, data: bytes, now: float) -> bytes:
        self._heard = now  # the manual: when no serial bytes are received; any byte counts
        return b"".join(
            self._execute(command, payload) for command, payload in self._packets.feed(data, now)
        )

    def _execute(self, command: int, payload: bytes) -> bytes:
        if command in WRITES:
            self._write(command, payload)
            return bytes((ACK,))
        reply = self._read(command)
        return b"" if reply is None else roboclaw_reply(self._address, command, reply)

    def _write(self, command: int, payload: bytes) -> None:
        if command == SET_TIMEOUT:
            self.timeout = payload[0]
        elif command == RESET_COUNTS:
            self._zero = list(self._body.turns)
        elif command == DUTY:
            top = (
                self._geometry.max_wheel_speed
                / self._geometry.wheel_radius
                * self._geometry.gear_ratio
                / math.tau
            )
            for channel, duty in enumerate(struct.unpack(">hh", payload)):
                self._set(channel, top * duty / 32767.0)
        elif command in (SPEED_M1, SPEED_M2):
            self._set(command - SPEED_M1, struct.unpack(">i", payload)[0] / self._counts_per_turn)
        else:
            self._body.ramp = math.inf
            if command == SPEED_ACCEL:
                self._body.ramp = struct.unpack(">I", payload[:4])[0] / self._counts_per_turn
            for channel, speed in enumerate(struct.unpack(">ii", payload[-8:])):
                self._set(channel, speed / self._counts_per_turn)
        self._watchdog(self._heard)

    def _read(self, command: int) -> bytes | None:
        counts = [int(wrapped(round(self._turns(i) * self._counts_per_turn))) for i in (0, 1)]
        speeds = [round(self._body.speeds[i] * self._counts_per_turn) for i in (0, 1)]
        if command == GET_TIMEOUT:
            return bytes((self.timeout,))
        if command == COUNTS:
            return struct.pack(">ii", *counts)
        if command == RAW_SPEEDS:
            return struct.pack(">ii", *speeds)
        if command in (ENCODER_M1, ENCODER_M2):
            return struct.pack(">iB", counts[command - ENCODER_M1], 0)
        if command in (SPEED_STATUS_M1, SPEED_STATUS_M2):
            speed = speeds[command - SPEED_STATUS_M1]
            return struct.pack(">IB", abs(speed), speed < 0)
        if command == STATUS:
            return self.status.to_bytes(self._status_bytes, "big")
        if command == VERSION:
            return b"USB Roboclaw 2x15a v4.2.8\n\x00"
        return struct.pack(">H", 126) if command == BATTERY else None
