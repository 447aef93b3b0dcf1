"""An RPLIDAR A1: it answers, and streams nodes from SCAN to STOP."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from firmware_bridge.sensors.lidar.rplidar_frames import (
    CIRCLE,
    GET_HEALTH,
    GET_INFO,
    HEALTH,
    INFO,
    NODES,
    RESET,
    SCAN,
    SET_PWM,
    STOP,
    SYNC,
    WITH_PAYLOAD,
    Node,
    descriptor,
    request,
)
from kmpc_lab.emulator.lidar.lidar import LidarEmulator, LidarModel, Pose
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

MODEL = LidarModel(rate=5.5, beams=360, reach=12.0)
A1, FIRMWARE, HARDWARE = 0x18, (29, 1), 7
"""Model, firmware minor and major, hardware."""
QUALITY = 47
BOOT_TEXT = b"RP LIDAR System.\r\nFirmware Ver 1.29, HW Ver 7\r\n"
LONGEST = 64
"""Of a request, with its payload."""


class RplidarEmulator(LidarEmulator):
    """See `LidarEmulator`; besides, its health may be set."""

    def __init__(
        self, world: World, pose: Callable[[], Pose], model: LidarModel, seed: int = 0, **how: Any
    ) -> None:
        super().__init__(world, pose, model, seed, **how)
        self.health = (0, 0)
        """Status (0 good, 1 warning, 2 error, which does not scan) and error code."""
        self.kind = A1
        self.pwm = 0
        self.scanning = False
        self._asked = bytearray()

    @property
    def _turning(self) -> bool:
        return self.scanning and self.health[0] < 2

    def _bytes(self, number: int, ranges: Array, now: float) -> bytes:
        sent, stuck = b"", self.faults.stuck
        for i, distance in enumerate(ranges):
            beam = number + (0 if stuck else i)
            angle = round(float(self.angles(beam)) * CIRCLE / math.tau) % CIRCLE
            quarters = round(4e3 * max(distance, 0.0)) if distance < 16.0 else 0
            start = beam % self.model.beams == 0 and not stuck
            sent += Node(angle, quarters, QUALITY if quarters else 0, start).to_bytes()
        return sent

    def _answer(self, data: bytes) -> bytes:
        self._asked += data
        answer = b""
        while (at := self._asked.find(SYNC)) >= 0 and len(self._asked) > at + 1:
            command = self._asked[at + 1]
            size = 2
            if command & WITH_PAYLOAD:
                if len(self._asked) < at + 3:
                    break
                size = 4 + self._asked[at + 2]
                if len(self._asked) < at + size:
                    break
            frame = bytes(self._asked[at : at + size])
            del self._asked[: at + size]
            answer += self._obey(command, frame)
        del self._asked[: max(0, len(self._asked) - LONGEST)]
        return answer

    def _obey(self, command: int, frame: bytes) -> bytes:
        """Carry out a request; gives what is answered."""
        payload = frame[3:-1]
        if command & WITH_PAYLOAD and frame != request(command, payload):
            return b""
        if command in (STOP, RESET):
            self.scanning = False
            if command == RESET:
                self.health = (0, 0) if self.health[0] < 2 else self.health
                return BOOT_TEXT
        elif command == GET_INFO:
            return descriptor(INFO) + bytes((self.kind, *FIRMWARE, HARDWARE)) + bytes(16)
        elif command == GET_HEALTH:
            status, code = self.health
            return descriptor(HEALTH) + bytes((status,)) + code.to_bytes(2, "little")
        elif command == SET_PWM:
            self.pwm = int.from_bytes(payload, "little")
        elif command == SCAN and self.health[0] < 2:
            self.scanning = True
            return descriptor(NODES)
        return b""
