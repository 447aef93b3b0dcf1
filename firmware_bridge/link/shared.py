"""A link that others share: all that comes from the board goes to them, and little of theirs back.

Whoever shares it is read at a small ration, and what it sends leaves in small portions, so that
neither the gate nor a command of ours waits for it.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from typing import Protocol

from firmware_bridge.link.protocol import OnBytes, Transport
from firmware_bridge.messages import LinkError

RATE, BURST = 2500.0, 320.0
"""What all stations may send to the board for long [bytes/s], and at once: two fifths of a radio of
57600 baud, and the longest frame, 0.05 s of it."""
WAITING = 64
"""Frames of stations that wait for their turn at most; one more is dropped."""
TOLD_AGAIN, TOLD_ELSE = 5.0, 0.5
"""Shortest time between two reports of a refusal to a station: same, and another one [s]."""


class Rules(Protocol):
    """What a station may send."""

    def cut(self) -> Callable[[bytes, float], Iterator[bytes]]:
        """Make what cuts the bytes of one station into whole frames."""
        ...

    def judge(self, frame: bytes) -> str:
        """Say why a frame must not pass; empty if it may."""
        ...

    def tell(self, text: str) -> bytes:
        """Frame a text that a station shows to its user."""
        ...


class Portions:
    """Lets frames go a few at a time; thread-safe.

    Parameters
    ----------
    write : callable
        Takes one frame.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self, write: Callable[[bytes], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._write, self._clock, self._lock = write, clock, Lock()
        self._waiting: deque[bytes] = deque()
        self._credit, self._stamp = BURST, clock()
        self.passed = self.dropped = 0

    def add(self, frame: bytes) -> None:
        """Take one more frame."""
        with self._lock:
            if len(self._waiting) >= WAITING:
                self.dropped += 1
            else:
                self._waiting.append(frame)
        self.go()

    def go(self) -> None:
        """Let go what may leave now."""
        if not self._waiting:
            return
        with self._lock:
            now = self._clock()
            self._credit = min(BURST, self._credit + RATE * (now - self._stamp))
            self._stamp = now
            while self._waiting and self._credit >= len(self._waiting[0]):
                frame = self._waiting.popleft()
                self._credit -= len(frame)
                self.passed += 1
                self._write(frame)


class SharedTransport:
    """A transport that passes what it hears on to stations, and what they may send to the board.

    Parameters
    ----------
    transport : Transport
        Of the board.
    stations : sequence of Transport
        Where others listen and speak.
    rules : Rules
        What they may send.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        transport: Transport,
        stations: Sequence[Transport],
        rules: Rules,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._transport, self._stations, self._rules = transport, stations, rules
        self._clock = clock
        self._portions = Portions(transport.write, clock)
        self._told = [("", -TOLD_AGAIN)] * len(stations)
        """The last report to each station, and when [s]."""
        self._open = False
        self.refused = 0
        self.refusal, self.refused_at = "", -float("inf")
        """What was refused last, in words, and when [s]."""

    def start(self, on_bytes: OnBytes) -> None:
        """Open the stations, then the board.

        Raises
        ------
        LinkError
            Names what cannot be opened.
        """

        def heard(data: bytes, stamp: float) -> None:
            for station in self._stations:
                station.write(data)
            self._portions.go()
            on_bytes(data, stamp)

        try:
            for number, station in enumerate(self._stations):
                station.start(self._hears(number))
            self._transport.start(heard)
        except LinkError:
            self.close()
            raise
        self._open = True

    def write(self, data: bytes) -> bool:
        """Send one frame of ours: before those of stations that wait."""
        return self._transport.write(data)

    @property
    def connected(self) -> bool:
        """Whether the board's link is open."""
        return self._transport.connected

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the board's link, and of the stations."""
        return {
            **self._transport.counters,
            "stations_passed": self._portions.passed,
            "stations_refused": self.refused,
            "stations_dropped": self._portions.dropped,
        }

    @property
    def last_error(self) -> str:
        """Why the board's link last went down."""
        return self._transport.last_error

    def close(self) -> None:
        """Close them all."""
        self._open = False
        for station in self._stations:
            station.close()
        self._transport.close()

    def _hears(self, number: int) -> OnBytes:
        cut = self._rules.cut()

        def take(data: bytes, stamp: float) -> None:
            for frame in cut(data, stamp):
                refusal = self._rules.judge(frame)
                if refusal:
                    self._refuse(number, refusal)
                elif self._open:
                    self._portions.add(frame)

        return take

    def _refuse(self, number: int, refusal: str) -> None:
        """Count a frame that does not pass, and tell its sender now and then."""
        self.refused += 1
        now = self._clock()
        self.refusal, self.refused_at = refusal, now
        last, since = self._told[number]
        if now - since >= (TOLD_AGAIN if refusal == last else TOLD_ELSE):
            self._told[number] = refusal, now
            self._stations[number].write(self._rules.tell(f"kmpc refused {refusal}"))
