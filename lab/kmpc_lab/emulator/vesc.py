"""VESCs, the second behind the first's CAN bus, or one with a servo: values, faults, time-outs.

After the time-out each coasts.
"""

from __future__ import annotations

import math
import struct
from typing import Unpack

from firmware_bridge.drivers.vesc import (
    ALIVE,
    FORWARD_CAN,
    FW_VERSION,
    GET_SELECTIVE,
    GET_VALUES,
    SET_BRAKE,
    SET_CURRENT,
    SET_RPM,
    SET_SERVO_POS,
    STEPS_PER_ELECTRIC_TURN,
    VescOptions,
)
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link.framing import VescPackets, vesc_packet
from firmware_bridge.odometry import wrapped
from kmpc_lab.emulator.board import BoardEmulator, Scene

LAYOUT = "h h i i i i h i h i i i i i i B i B".split()
"""Formats of the fields of GET_VALUES, in the order of the bits of the selective mask."""


class VescEmulator(BoardEmulator):
    """VESCs with a robot on top.

    `geometry`, `options`: of the robot, as for the driver. `local_id`: controller id of the first.
    `selective`: whether the firmware knows GET_VALUES_SELECTIVE. `timeout`: without a command for
    so long, a motor is let go [s]. `**around`: see `Scene`.
    """

    boot_text = b"\x02\x03VESC\r\n"
    options_type = VescOptions

    def __init__(
        self,
        geometry: Geometry,
        options: VescOptions,
        local_id: int = 77,
        selective: bool = True,
        timeout: float = 1.0,
        **around: Unpack[Scene],
    ) -> None:
        super().__init__(geometry, **around)
        self._ids, self._options = (local_id, options.can_id), options
        self._erpm = 60.0 * options.pole_pairs
        self._selective = selective
        self._steps = STEPS_PER_ELECTRIC_TURN * options.pole_pairs
        self.timeout = timeout
        self._fed = [-math.inf] * len(geometry.names)
        self._packets = VescPackets()
        self.faults = [0] * len(self._fed)
        """Fault codes of all; set them to see what the other end does."""
        self._let_go_all()

    def _reset(self) -> None:
        self.faults, self._fed = [0] * len(self._fed), [-math.inf] * len(self._fed)

    def _watchdog(self, now: float) -> None:
        for channel in range(len(self._fed)):
            if self.faults[channel] or now - self._fed[channel] > self.timeout:
                self._let_go(channel)

    def _answer(self, data: bytes, now: float) -> bytes:
        out = b""
        for payload in self._packets.feed(data, now):
            channel = 0
            if payload[0] == FORWARD_CAN and len(payload) > 2:
                if payload[1] != self._ids[1]:
                    continue
                channel, payload = 1, payload[2:]
            reply = self._execute(channel, payload, now)
            if reply is not None:
                out += vesc_packet(reply)
        return out

    def _execute(self, channel: int, payload: bytes, now: float) -> bytes | None:
        command = payload[0]
        if command == FW_VERSION:
            return bytes((FW_VERSION, 6, 2)) + b"60_MK5\0" + bytes(12) + bytes((0, 0, 0, 0))
        if command == GET_VALUES:
            return bytes((GET_VALUES,)) + self._fields(channel, 2**18 - 1) + bytes(15)
        if command == GET_SELECTIVE and self._selective and len(payload) == 5:
            return payload + self._fields(channel, int.from_bytes(payload[1:], "big"))
        if command == SET_SERVO_POS and len(payload) == 3:
            straight, left = self._options.servo_straight, self._options.servo_left
            position = min(max(struct.unpack(">h", payload[1:])[0] / 1000.0, 0.0), 1.0)
            self._body.steered = min(max((position - straight) / (left - straight), -1.0), 1.0)
        if command == ALIVE:
            self._fed[channel] = now
        if command in (SET_RPM, SET_CURRENT, SET_BRAKE) and len(payload) == 5:
            self._fed[channel] = now
            value = struct.unpack(">i", payload[1:])[0]
            if command == SET_RPM and value:
                self._set(channel, value / self._erpm)
            elif command == SET_BRAKE:
                self._set(channel, 0.0)
            elif command == SET_RPM or value == 0:
                self._let_go(channel)
            self._watchdog(now)
        return None

    def _fields(self, channel: int, mask: int) -> bytes:
        values = [250, 250] + [0] * 12 + [0, 0, 0, self._ids[channel]]
        values[7] = round(self._body.speeds[channel] * self._erpm)
        values[8] = 126
        values[13] = int(wrapped(round(self._turns(channel) * self._steps)))
        values[15] = self.faults[channel]
        return b"".join(
            struct.pack(f">{LAYOUT[bit]}", values[bit])
            for bit in range(len(LAYOUT))
            if mask >> bit & 1
        )
