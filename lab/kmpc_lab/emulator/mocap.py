"""An emulated motion-capture system: true poses at a rate, noisy, late, and sometimes missing."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from firmware_bridge.link.url import LinkUrl
from firmware_bridge.options import bounded, check

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class MocapOptions:
    """How good it is; the defaults are an ordinary room's."""

    rate: float = bounded(1.0, 1000.0, "Hz", 50.0)  # poses per second [Hz]
    noise: float = bounded(0.0, 1.0, "m", 0.001)  # standard deviation of x and y [m]
    heading_noise: float = bounded(0.0, 1.0, "rad", 0.002)
    """Standard deviation of the heading [rad]."""
    delay: float = bounded(0.0, 1.0, "s", 0.01)  # from the exposure to our computer [s]
    dropouts: float = bounded(0.0, 10.0, "per s", 0.0)  # how often the markers are hidden [1/s]
    hidden: float = bounded(0.0, 10.0, "s", 0.1)  # for how long then [s]

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


class Mocap:
    """Looks at a robot whenever a picture is due.

    `options`: see there. `seed`: of noise and drop-outs. `now`: time of the first picture [s].
    """

    def __init__(self, options: MocapOptions, seed: int, now: float) -> None:
        self.options, self._random = options, random.Random(seed)
        self._due, self._hidden_until = now, now
        self._coming: deque[tuple[float, Pose]] = deque()

    def look(self, now: float, pose: Pose) -> list[tuple[float, Pose]]:
        """Take the true pose now; gives what arrives now: (time of exposure [s], measured pose)."""
        o = self.options
        if now >= self._due - 1e-9:
            self._due += 1.0 / o.rate
            if self._random.random() < o.dropouts / o.rate:
                self._hidden_until = now + o.hidden
            if now >= self._hidden_until:
                x, y, theta = pose
                gauss = self._random.gauss
                self._coming.append(
                    (
                        now,
                        (
                            x + gauss(0.0, o.noise),
                            y + gauss(0.0, o.noise),
                            theta + gauss(0.0, o.heading_noise),
                        ),
                    )
                )
        arrived = []
        while self._coming and self._coming[0][0] + o.delay <= now + 1e-9:
            arrived.append(self._coming.popleft())
        return arrived


class MocapSender:
    """Sends what a `Mocap` sees, a datagram each.

    A datagram is ``stamp x y theta``, as `firmware_bridge.sensors.pose` reads it.

    `pose`: True x, y [m], theta [rad]. `url`: udp:HOST:PORT to send to. `seed`: of the noise.
    `options`: how good it is.
    """

    def __init__(
        self, pose: Callable[[], Pose], url: str, seed: int = 0, options: MocapOptions | None = None
    ) -> None:
        self._pose, self._address = pose, LinkUrl.parse(url).address()
        self._options, self._seed = MocapOptions() if options is None else options, seed
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mocap", daemon=True)

    def start(self) -> None:
        """Begin to send, whether or not somebody listens."""
        self._thread.start()

    def close(self) -> None:
        """Send no more; idempotent."""
        self._quit.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        mocap, pause = Mocap(self._options, self._seed, time.monotonic()), 0.25 / self._options.rate
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not self._quit.wait(pause):
                for stamp, (x, y, theta) in mocap.look(time.monotonic(), self._pose()):
                    try:
                        sock.sendto(
                            f"{stamp:.6f} {x:.6f} {y:.6f} {theta:.6f}".encode(), self._address
                        )
                    except OSError:
                        continue  # nobody listens yet: a pose that is lost is lost
