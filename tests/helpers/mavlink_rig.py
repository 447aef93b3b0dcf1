"""The driver's core and the emulated rover on one clock that only tests turn, with a wire that
tests can spoil.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from kmpc_lab.emulator.rover.rover import RoverEmulator

Filter = Callable[[bytes], list[bytes]]
SLICE = 0.005
SET_POINT_CRC_EXTRA = 143


def crc16_mcrf4xx(data: bytes) -> int:
    """CRC-16/MCRF4XX bit by bit: poly 0x1021 reflected, init 0xFFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0x8408 if crc & 1 else crc >> 1
    return crc


def set_point_frame(
    boot_ms: int, v: float, omega: float, sequence: int = 0, system: int = 255, component: int = 190
) -> bytes:
    """SET_POSITION_TARGET_LOCAL_NED of mask 0x5C7, frame 8, from the message definition alone."""
    fields = (boot_ms, 0, 0, 0, v, 0, 0, 0, 0, 0, 0, -omega + 0.0, 0x5C7, 1, 1, 8)
    payload = struct.pack("<I11fHBBB", *fields).rstrip(b"\0")
    head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence, system, component) + (84).to_bytes(
        3, "little"
    )
    return (
        b"\xfd"
        + head
        + payload
        + struct.pack("<H", crc16_mcrf4xx(head + payload + bytes((SET_POINT_CRC_EXTRA,))))
    )


class Rig:
    """A driver without threads and a rover, `latency` [s] apart each way."""

    def __init__(
        self,
        options: MavlinkOptions | None = None,
        *,
        latency: float = 0.0,
        clock_offset: float = 1000.0,
        **rover: object,
    ) -> None:
        self.now = clock_offset
        self.latency = latency
        self.to_rover: Filter = lambda frame: [frame]
        self.to_core: Filter = lambda frame: [frame]
        self.sent: list[tuple[float, bytes]] = []
        self._down: deque[tuple[float, bytes]] = deque()
        self._up: deque[tuple[float, bytes]] = deque()
        self.rover = RoverEmulator(clock=lambda: self.now, **rover)  # type: ignore[arg-type]
        self.rover.connect(
            lambda frame: self._up.extend((self.now + self.latency, f) for f in self.to_core(frame))
        )
        self.core = MavlinkCore(
            MavlinkOptions() if options is None else options, self._write, 1.7e9
        )
        self._tick_due = self.now

    def _write(self, frame: bytes) -> None:
        self.sent.append((self.now, frame))
        self._down.extend((self.now + self.latency, f) for f in self.to_rover(frame))

    def run(
        self, seconds: float, each: Callable[[], None] | None = None, period: float = 0.02
    ) -> None:
        """Let time pass; `each` is called every `period`."""
        end, due = self.now + seconds, self.now
        while self.now < end - 1e-9:
            if each is not None and self.now >= due - 1e-9:
                due += period
                each()
            self.now += SLICE
            while self._down and self._down[0][0] <= self.now + 1e-9:
                self.rover.receive(self._down.popleft()[1], self.now)
            self.rover.step()
            while self._up and self._up[0][0] <= self.now + 1e-9:
                self.core.receive(self._up.popleft()[1], self.now)
            if self.now >= self._tick_due - 1e-9:
                self._tick_due += 0.05
                self.core.tick(self.now)

    def until(self, condition: Callable[[], bool], limit: float = 60.0) -> float:
        """Let time pass until something holds; how long that took."""
        start = self.now
        while not condition():
            assert self.now - start < limit, f"not within {limit} s"
            self.run(SLICE)
        return self.now - start

    def drive(self, v: float, omega: float, seconds: float, period: float = 0.02) -> None:
        """Send a set-point every `period`."""
        self.run(seconds, lambda: self.core.set_point(v, omega, self.now), period)

    @property
    def ready(self) -> bool:
        """As the gate sees it."""
        return self.core.status(self.now, True).ready

    @property
    def faults(self) -> tuple[str, ...]:
        """As the gate sees them."""
        return self.core.status(self.now, True).faults

    def take(self) -> None:
        """Wait for the vehicle, then take it."""
        self.until(lambda: self.core.identified)
        self.core.take(self.now)
        self.until(lambda: self.ready)


def decode(frames: list[bytes]) -> list[object]:
    """Messages of frames, with the dialect alone."""
    parser = dialect.MAVLink(None)
    return [parser.decode(bytearray(frame)) for frame in frames]


def other(system: int, component: int = 1) -> MavlinkCodec:
    """Another station on the link."""
    return MavlinkCodec(system, component)


def error(rig: Rig) -> tuple[float, float]:
    """Distance and angle between the driver's state and the truth at its stamp, for a rover
    that is not accelerating.
    """
    state = rig.core.state
    assert state is not None
    x, y, theta = rig.rover.pose
    east, north, turn = rig.rover.velocity
    ago = rig.now - state.stamp
    return math.hypot(x - east * ago - state.x, y - north * ago - state.y), abs(
        math.remainder(theta - turn * ago - state.theta, math.tau)
    )
