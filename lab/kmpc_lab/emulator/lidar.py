"""Emulated lidars: a motor, rays from where the robot is, a link, and faults.

An LD06 or LD19 sends packets of twelve points from the moment it has power; an RPLIDAR A1 answers,
and streams nodes from SCAN to STOP.
"""

from __future__ import annotations

import math
import random
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.link import Transport
from firmware_bridge.link.server import line_speed, serve
from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check
from firmware_bridge.sensors.lidar.ld06 import CIRCLE as HUNDREDTHS
from firmware_bridge.sensors.lidar.ld06 import POINTS, Ld06Packet
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.lidar.rplidar import (
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
from kmpc_lite.scenario.world import World, world_of
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario

Pose = tuple[float, float, float]
PERIOD = 0.01  # between two looks at the clock [s]
LONGEST_CATCH_UP = 0.5  # after a stall longer than this the lidar has lost that time [s]
INTENSITY = 200
WRAP = 30000  # of the time stamp [ms]
A1, FIRMWARE, HARDWARE = 0x18, (29, 1), 7  # model, firmware minor and major, hardware
QUALITY = 47
BOOT_TEXT = b"RP LIDAR System.\r\nFirmware Ver 1.29, HW Ver 7\r\n"
LONGEST = 64  # of a request, with its payload


@dataclass(frozen=True)
class LidarModel:
    """How good it is, and where it is mounted."""

    rate: float = bounded(0.5, 50.0, "Hz", 10.0)  # turns per second [Hz]
    beams: int = bounded(24, 4096, "", 450)  # of a turn
    reach: float = bounded(0.1, 1000.0, "m", 12.0)  # [m]
    noise: float = bounded(0.0, 1.0, "m", 0.01)  # standard deviation of a distance [m]
    dropouts: float = bounded(0.0, 1.0, "", 0.01)  # share of beams that do not come back
    mount: Pose = (0.0, 0.0, 0.0)  # where it is on the robot [m, m, rad]
    mirrored: bool = False  # whether it hangs upside down

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


@dataclass
class LidarFaults:
    """What goes wrong; a test sets it while the lidar turns."""

    stuck: bool = False  # the motor does not turn
    mute: bool = False  # nothing is sent
    lost: float = 0.0  # share of bytes that are lost on the line
    wrong: float = 0.0  # share of bytes of which a bit is wrong
    garbage: float = 0.0  # random bytes between packets, for each byte of a packet
    covered: bool = False  # no beam comes back


class LidarEmulator:
    """A lidar on a robot in a world.

    A kind of lidar makes bytes of beams (`_bytes`), and may answer (`_answer`).

    `world`: what it sees. `pose`: True x, y [m], theta [rad] of the robot. `model`: how good it is.
    `seed`: of noise and faults. `clock`: monotonic time [s]. `baud`: speed of its line; a
    pseudo-terminal at another speed carries garbage.
    """

    def __init__(
        self,
        world: World,
        pose: Callable[[], Pose],
        model: LidarModel,
        seed: int = 0,
        *,
        clock: Callable[[], float] = time.monotonic,
        baud: int | None = None,
    ) -> None:
        self.world, self.model, self.faults = world, model, LidarFaults()
        self._pose, self._clock, self._baud = pose, clock, baud
        self._random, self._noise = random.Random(seed), np.random.default_rng(seed)
        self._began = self._time = clock()
        self._last_pose = pose()
        self._count = 0
        self._lock = threading.RLock()
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None
        self._transport: Transport | None = None

    # What a kind of lidar adds

    def _bytes(self, number: int, ranges: Array, now: float) -> bytes:
        """Bytes of beams (N,) [m], the first of which is beam `number` since the start."""
        raise NotImplementedError

    def _answer(self, data: bytes) -> bytes:
        """Answer requests."""
        return b""

    @property
    def _turning(self) -> bool:
        """Whether the motor is on, and the lidar measures."""
        return True

    # For everybody

    def start(self, url: str) -> None:
        """Serve a link (pty:, tcp:, udp:) until `close`; LinkError if that fails."""
        transport = serve(url)
        transport.start(self._receive)
        self._transport, self._quit = transport, threading.Event()
        self._thread = threading.Thread(target=self._run, name="lidar", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Pull the plug; `start` puts it back in. Idempotent."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
        transport, self._transport, self._thread = self._transport, None, None
        if transport is not None:
            transport.close()

    def advance(self) -> bytes:
        """Turn up to the present time, and give what is sent."""
        with self._lock:
            now, pose = self._clock(), self._pose()
            before, begin = self._last_pose, self._time
            self._last_pose, self._time = pose, now
            if not self._turning or now - begin > LONGEST_CATCH_UP:
                return b""
            speed = self.model.rate * self.model.beams
            first = math.ceil((begin - self._began) * speed)
            count = math.ceil((now - self._began) * speed) - first
            if count <= 0:
                return b""
            share = ((first + np.arange(count)) / speed + self._began - begin) / (now - begin)
            sent = self._bytes(self._count, self._look(before, pose, share, now), now)
            self._count += 0 if self.faults.stuck else count
            return self._spoiled(sent)

    def _look(self, before: Pose, pose: Pose, share: Array, now: float) -> Array:
        """Distances of beams measured between two poses; inf for none."""
        model, faults = self.model, self.faults
        way = np.array(before) + share[:, None] * (np.array(pose) - np.array(before))
        number = self._count + np.arange(len(share)) * (not faults.stuck)
        turned = self.angles(number) * (1.0 if model.mirrored else -1.0)
        x, y, theta = model.mount
        cos, sin = np.cos(way[:, 2]), np.sin(way[:, 2])
        places = way[:, :2] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
        ranges = self.world.ranges(places, way[:, 2] + theta + turned, now - self._began)
        ranges = ranges + self._noise.normal(0.0, model.noise, len(ranges))
        lost = (self._noise.random(len(ranges)) < model.dropouts) | faults.covered
        return np.where(lost | (ranges > model.reach), np.inf, ranges)

    def angles(self, number: ArrayLike) -> Array:
        """Clockwise angle of beam number `number` [rad]."""
        return math.tau / self.model.beams * (np.asarray(number) % self.model.beams)

    def _spoiled(self, data: bytes) -> bytes:
        faults, chance = self.faults, self._random.random
        if faults.mute:
            return b""
        if not (faults.lost or faults.wrong or faults.garbage):
            return data
        spoiled = bytearray()
        for byte in data:
            if chance() < faults.garbage:
                spoiled.append(self._random.randrange(256))
            if chance() >= faults.lost:
                bit = 1 << self._random.randrange(8)
                spoiled.append(byte ^ (bit if chance() < faults.wrong else 0))
        return bytes(spoiled)

    def _receive(self, data: bytes, stamp: float) -> None:
        with self._lock:
            answer = self._answer(data)
        self._send(answer)

    def _send(self, data: bytes) -> None:
        transport = self._transport
        if transport is None or not data:
            return
        if self._baud is not None and line_speed(transport) not in (None, self._baud):
            data = self._random.randbytes(len(data))
        transport.write(data)

    def _run(self) -> None:
        while not self._quit.wait(PERIOD):
            self._send(self.advance())


LD06 = LidarModel(rate=10.0, beams=450, reach=12.0)


class Ld06Emulator(LidarEmulator):
    """See `LidarEmulator`."""

    _waiting: deque[tuple[int, int]]
    """Angle [0.01 deg] and distance [mm] of points that fill no packet yet."""

    def _bytes(self, number: int, ranges: Array, now: float) -> bytes:
        waiting = self.__dict__.setdefault("_waiting", deque())
        stuck = self.faults.stuck
        for i, distance in enumerate(ranges):
            angle = float(self.angles(number + (0 if stuck else i)))
            hundredths = round(angle * HUNDREDTHS / math.tau) % HUNDREDTHS
            waiting.append((hundredths, round(1e3 * distance) if distance < 65.0 else 0))
        sent = b""
        speed = 0 if stuck else round(360.0 * self.model.rate)
        while len(waiting) >= POINTS:
            points = [waiting.popleft() for _ in range(POINTS)]
            packet = Ld06Packet(
                speed,
                points[0][0],
                tuple((max(0, mm), INTENSITY) for _, mm in points),
                points[-1][0],
                round(1e3 * now) % WRAP,
            )
            sent += packet.to_bytes()
        return sent


RPLIDAR = LidarModel(rate=5.5, beams=360, reach=12.0)


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


class Eyes:
    """What the emulated robot of a robot file sees through its lidar.

    `options`: the robot file's. `scenario`: whose obstacles are seen. `seed`: of noise and
    drop-outs. Raises ConfigError if one of them is missing.
    """

    def __init__(self, options: LidarOptions | None, scenario: Scenario | None, seed: int) -> None:
        if options is None:
            raise ConfigError("--lidar: the robot has no [lidar]: give --lidar NAME")
        if scenario is None:
            raise ConfigError("--lidar: nothing to see: give --scenario NAME")
        self._options, self._world, self._seed = options, world_of(scenario), seed

    def served(self, pose: Callable[[], Pose]) -> tuple[LidarEmulator, str]:
        """Lidar of a robot at `pose`, and the URL to serve it at."""
        assert self._options.link is not None
        lidar = emulated_lidar(self._options, self._world, pose, self._seed)
        return lidar, self._options.link


def emulated_lidar(
    options: LidarOptions, world: World, pose: Callable[[], Pose], seed: int = 0
) -> LidarEmulator:
    """Build a lidar that has a link of its own, mounted as the robot file says."""
    model = {"rplidar": RPLIDAR, "ld06": LD06}[options.driver]
    there = replace(model, mount=options.mount, mirrored=options.mirrored)
    if options.driver == "rplidar":
        return RplidarEmulator(world, pose, there, seed)
    return Ld06Emulator(world, pose, there, seed)
