"""What every lidar offers, and what those on a serial line share."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError
from firmware_bridge.sensors.lidar.turns import Turns
from firmware_bridge.sensors.scan import Sweep

SILENCE = 1.0
"""A lidar that sends nothing for so long is not heard [s]."""


@dataclass(frozen=True)
class LidarHealth:
    """What is known of a lidar."""

    connected: bool
    """Whether its link is open."""
    name: str
    """What it says it is."""
    rate: float
    """Turns, or scans, per second [Hz]; 0 if none come."""
    faults: tuple[str, ...] = ()
    """Why no scans come, in words to act on."""
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
    bauds = ""
    """Its usual speed, for a hint."""
    TEND = 0.05
    """Between two looks of `_tend` [s]."""

    def __init__(self, transport: Transport, turns: Turns) -> None:
        self._transport, self._turns = transport, turns
        self._lock = threading.Lock()
        """Held while bytes are taken, for one read, or forgotten."""
        self._quit, self._turned = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._heard = -math.inf
        """When the last whole packet came [s]."""
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
