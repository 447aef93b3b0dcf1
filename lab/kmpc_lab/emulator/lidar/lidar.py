"""What the emulated lidars share: a motor, rays from where the robot is, a link, and faults."""

from __future__ import annotations

import math
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.link import Transport
from firmware_bridge.link.server import line_speed, serve
from firmware_bridge.options import bounded, check
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

Pose = tuple[float, float, float]
PERIOD = 0.01
"""Between two looks at the clock [s]."""
LONGEST_CATCH_UP = 0.5
"""After a stall longer than this the lidar has lost that time [s]."""


@dataclass(frozen=True)
class LidarModel:
    """How good it is, and where it is mounted."""

    rate: float = bounded(0.5, 50.0, "Hz", 10.0)
    """Turns per second [Hz]."""
    beams: int = bounded(24, 4096, "", 450)
    """Of a turn."""
    reach: float = bounded(0.1, 1000.0, "m", 12.0)
    """[m]"""
    noise: float = bounded(0.0, 1.0, "m", 0.01)
    """Standard deviation of a distance [m]."""
    dropouts: float = bounded(0.0, 1.0, "", 0.01)
    """Share of beams that do not come back."""
    mount: Pose = (0.0, 0.0, 0.0)
    """Where it is on the robot [m, m, rad]."""
    mirrored: bool = False
    """Whether it hangs upside down."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


@dataclass
class LidarFaults:
    """What goes wrong; a test sets it while the lidar turns."""

    stuck: bool = False
    """The motor does not turn."""
    mute: bool = False
    """Nothing is sent."""
    lost: float = 0.0
    """Share of bytes that are lost on the line."""
    wrong: float = 0.0
    """Share of bytes of which a bit is wrong."""
    garbage: float = 0.0
    """Random bytes between packets, for each byte of a packet."""
    covered: bool = False
    """No beam comes back."""


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
