"""What every lidar offers, and what those on a serial line share.

Beams are made whole turns as they arrive: where one ends, and when each beam was measured.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Protocol

import numpy as np

from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError
from firmware_bridge.sensors.sight import Sweep

LONGEST = 8192  # a turn of more beams is none: a sensor whose angle does not advance, or a flood
FEWEST = 24  # a turn of fewer beams is none
PARTS = 36
"""Equal parts of a turn, of which at least half must hold a beam: a motor that is stuck, or
jitters, makes no turn."""
SLOWEST, FASTEST = 1.0, 0.02  # how long a turn may take, and must [s]
RECENT = 9  # number of recent turns from which the time of the next is estimated
RATE_AGE = 2.0  # a sensor whose last turn is older turns no more [s]
SILENCE = 1.0  # a lidar that sends nothing for so long is not heard [s]


class Turns:
    """Collects beams of a sensor that turns clockwise.

    A beam is stamped by its angle: the turn lasts from the arrival of its first beam to that of
    the next turn's first one, so that neither the size of packets nor that of reads matters. The
    first turn, whose beginning is unknown, does not count.

    `range_min`, `range_max`: of the sensor [m].
    """

    def __init__(self, range_min: float, range_max: float) -> None:
        self._limits = range_min, range_max
        self._angles: list[float] = []
        self._ranges: list[float] = []
        self._began, self._last = -math.inf, 0.0
        self._times: deque[float] = deque(maxlen=RECENT)
        self.newest: Sweep | None = None
        self.counters = dict.fromkeys(("turns", "broken_turns"), 0)

    def add(self, angles: Iterable[float], ranges: Iterable[float], stamp: float) -> None:
        """Take beams that came at `stamp` [s]: clockwise angles, 0 to a turn [rad], and [m] or NaN.

        Where the angle falls by more than half a turn, another turn begins: a bit that says so
        may be lost.
        """
        if len(self._angles) >= LONGEST:
            self.counters["broken_turns"] += 1
            self.drop()
        for angle, distance in zip(angles, ranges, strict=True):
            if self._last - angle > math.pi:
                self._end(stamp)
            self._last = angle
            self._angles.append(angle)
            self._ranges.append(distance)

    def _end(self, stamp: float) -> None:
        """End the turn: the next beam is the first of another."""
        began, self._began = self._began, stamp
        angles, self._angles = np.array(self._angles), []
        ranges, self._ranges = np.array(self._ranges), []
        took = stamp - began
        if not _whole(angles) or not FASTEST <= took <= SLOWEST:
            self.counters["broken_turns"] += math.isfinite(took)
            return
        self._times.append(took)
        # a read that came late must not stretch the turn
        usual = median(self._times)
        took = min(max(took, 0.5 * usual), 1.5 * usual)
        swept = np.unwrap(angles) - angles[0]
        stamps = stamp - took * (1.0 - np.clip(swept / math.tau, 0.0, 1.0))
        self.newest = Sweep(-angles, ranges, stamps, *self._limits)
        self.counters["turns"] += 1

    def drop(self) -> None:
        """Forget the turn under way."""
        self._angles, self._ranges, self._began, self._last = [], [], -math.inf, 0.0

    def rate(self, now: float) -> float:
        """Turns per second [Hz]; 0 if it does not turn."""
        times = tuple(self._times)  # another thread adds
        if not times or self.newest is None or now - self.newest.stamp > RATE_AGE:
            return 0.0
        return 1.0 / median(times)


def _whole(angles: np.ndarray) -> bool:
    """Whether beams (N,) [rad] cover enough of a turn."""
    if len(angles) < FEWEST:
        return False
    parts = np.floor(np.mod(angles, math.tau) / math.tau * PARTS).astype(int)
    return len(np.unique(parts)) >= PARTS // 2


@dataclass(frozen=True)
class LidarHealth:
    """What is known of a lidar."""

    connected: bool  # whether its link is open
    name: str  # what it says it is
    rate: float  # turns, or scans, per second [Hz]; 0 if none come
    faults: tuple[str, ...] = ()  # why no scans come, in words to act on
    counters: Mapping[str, int] = field(default_factory=dict)


class Lidar(Protocol):
    """A source of scans; all methods but `connect` return at once."""

    def connect(self, timeout: float) -> None:
        """Open the link, start the sensor, wait for its first turn; LinkError without one."""

    def sweep(self) -> Sweep | None:
        """Newest whole turn, None before the first."""

    def health(self) -> LidarHealth:
        """What is known of the sensor."""

    def close(self) -> None:
        """Stop the sensor and close the link; idempotent."""


class SerialLidar:
    """A lidar that turns, on a link of its own.

    A subclass takes bytes (`_take`), and may do something from time to time (`_tend`), which runs
    in a thread of the lidar.

    `transport`: not yet started; the lidar starts and closes it. `turns`: collects its beams.
    """

    name = "lidar"
    bauds = ""  # its usual speed, for a hint
    TEND = 0.05  # between two looks of `_tend` [s]

    def __init__(self, transport: Transport, turns: Turns) -> None:
        self._transport, self._turns = transport, turns
        self._lock = threading.Lock()  # held while bytes are taken, for one read, or forgotten
        self._quit, self._turned = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._heard = -math.inf  # when the last whole packet came [s]
        self._errors, self._error = 0, ""

    # What a kind of lidar adds

    def _take(self, data: bytes, stamp: float) -> bool:
        """Take bytes (I/O thread); return whether they held a whole packet."""
        raise NotImplementedError

    def _tend(self, now: float) -> None:
        """Start the sensor, and start it again where it has stopped."""

    def _farewell(self) -> None:
        """Say the last words to the sensor."""

    def _troubles(self, now: float) -> tuple[str, ...]:
        """What the sensor itself reports, in words."""
        return ()

    def _counts(self) -> dict[str, int]:
        """What the decoder counts."""
        return {}

    # Lidar protocol

    def connect(self, timeout: float) -> None:
        """Open the link, start the sensor and wait for its first turn."""
        try:
            self._transport.start(self._on_bytes)
            self._thread = threading.Thread(target=self._run, name="bridge-lidar", daemon=True)
            self._thread.start()
            if not self._turned.wait(timeout):
                words = "; ".join(self.health().faults) or "it does not turn"
                raise LinkError(f"lidar: no turn within {timeout:g} s: {words}")
        except LinkError:
            self.close()
            raise

    def sweep(self) -> Sweep | None:
        """Newest whole turn."""
        return self._turns.newest

    def health(self) -> LidarHealth:
        """What is known of the sensor."""
        # without the lock: the gate must not wait for a flood
        now, transport = time.monotonic(), self._transport
        rate, heard = self._turns.rate(now), now - self._heard <= SILENCE
        counters = {**transport.counters, **self._counts(), **self._turns.counters}
        counters["internal_errors"] = self._errors
        faults = [*self._troubles(now), *filter(None, (self._error,))]
        if not transport.connected:
            faults.append(f"lidar: {transport.last_error or 'its link is not open'}")
        elif not heard:
            faults.append(self._silent(counters.get("bytes_in", 0)))
        elif rate == 0.0:
            faults.append(
                f"lidar: {self.name} is heard, but makes no whole turn: is its motor free?"
            )
        return LidarHealth(transport.connected, self.name, rate, tuple(faults), counters)

    def close(self) -> None:
        """Stop the sensor and close the link; idempotent."""
        if self._quit.is_set():
            return
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
            self._farewell()
            time.sleep(self.TEND)  # the last words leave before the link is closed
        self._transport.close()

    def _silent(self, size: int) -> str:
        if not size:
            return "lidar: no byte: is it powered, and are its lines crossed?"
        return (
            f"lidar: {size} bytes, but no packet of {self.name} for {SILENCE:g} s: is the baud "
            f"rate right ({self.bauds}), and is it this lidar?"
        )

    def _on_bytes(self, data: bytes, stamp: float) -> None:
        """Take what arrived (I/O thread); errors are counted and reported; it goes on."""
        try:
            with self._lock:
                if self._take(data, stamp):
                    self._heard = stamp
        except Exception as error:
            self._note(error)
        if self._turns.newest is not None:
            self._turned.set()

    def _run(self) -> None:
        """Look after the sensor until it is closed."""
        while not self._quit.is_set():
            try:
                if self._transport.connected:
                    self._tend(time.monotonic())
            except Exception as error:
                self._note(error)
            self._quit.wait(self.TEND)

    def _note(self, error: Exception) -> None:
        self._errors += 1
        self._error = f"lidar: internal error: {type(error).__name__}: {error}"
