"""What every link offers, and the I/O thread of one: it alone touches the port, and reopens it.

A reader takes in so much at a time: a flood then waits, and the safety gate does not.
"""

from __future__ import annotations

import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from firmware_bridge.messages import LinkError

SHARE = 1.0 / 3.0
"""Share of one core that taking in one link may use for long; telemetry at 40 Hz needs 0.02."""
BYTES = 1e6
"""Bytes per second that may be read for long: ten times the fastest serial line. Whatever is read
is recorded, and no flood is to fill the disk."""
BURST = 0.01  # work that may be done at once after a pause [s]: half a period of the gate
QUEUE_FRAMES = 32
BACKOFF_FIRST, BACKOFF_LAST = 0.05, 0.5
READABLE = select.POLLIN | select.POLLERR | select.POLLHUP | select.POLLNVAL
COUNTERS = "bytes_in", "bytes_out", "reconnects", "dropped_frames", "refused_writes", "errors"
OnBytes = Callable[[bytes, float], None]
"""Called in the I/O thread with what arrived and `time.monotonic()`."""


class Ration:
    """Counts the processor time that a thread spends on what it reads, and makes it rest.

    Processor time, not time on the wall: a machine that stutters costs the reader nothing.

    `clock`: monotonic time [s]. `work`: processor time of the calling thread [s]. `share`, `most`:
    share of a core, and bytes per second, for long.

    Examples
    --------
    >>> now, spent = [0.0], [0.0]
    >>> ration = Ration(lambda: now[0], lambda: spent[0])
    >>> ration.begin()
    >>> spent[0] = 0.03
    >>> ration.end(100)
    >>> round(ration.rest(), 3)
    0.06
    >>> now[0] = 0.07
    >>> ration.rest()
    0.0
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        work: Callable[[], float] = time.thread_time,
        share: float = SHARE,
        most: float = BYTES,
    ) -> None:
        self._clock, self._work, self._share, self._most = clock, work, share, most
        self._credit, self._stamp, self._from = BURST, clock(), 0.0

    def begin(self) -> None:
        """Begin to work."""
        self._from = self._work()

    def end(self, size: int) -> None:
        """Count the work since `begin`, or the bytes that were read where these weigh more."""
        self._refill()
        self._credit -= max(self._work() - self._from, self._share * size / self._most)

    def rest(self) -> float:
        """How long to read nothing [s]."""
        if self._credit >= 0.0:
            return 0.0
        self._refill()
        return max(0.0, -self._credit / self._share)

    def _refill(self) -> None:
        now = self._clock()
        self._credit = min(BURST, self._credit + self._share * (now - self._stamp))
        self._stamp = now


class Transport(Protocol):
    """One open link. One I/O thread owns the port; writing never blocks."""

    def start(self, on_bytes: OnBytes) -> None:
        """Open and start the I/O thread; raises LinkError if the first opening fails."""

    def write(self, data: bytes) -> bool:
        """Queue one whole frame; a full queue drops its oldest. False if the link is down."""

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""

    @property
    def counters(self) -> dict[str, int]:
        """`COUNTERS` since the start."""

    @property
    def last_error(self) -> str:
        """Why the link last went down, in words; empty if it never did."""

    def close(self) -> None:
        """Stop the thread and close the port; idempotent."""


class Port(Protocol):
    """An open, non-blocking port; OSError: the other end is gone."""

    def fileno(self) -> int:
        """Descriptor to poll."""

    def read(self) -> bytes:
        """Take a little of what has arrived, empty if nothing."""

    def write(self, data: memoryview) -> int:
        """Bytes that the port took now, possibly 0."""

    def close(self) -> None:
        """Give the descriptor back."""


class Endpoint:
    """Where a port comes from, time and again."""

    def open(self) -> Port | None:
        """Open it; None without a peer yet. Raises LinkError in words a user can act on."""
        raise NotImplementedError

    def fileno(self) -> int | None:
        """Descriptor that becomes readable when `open` is worth a try; None: try after a while."""
        return None

    def turn_away(self) -> None:
        """Handle a peer that connects while a port is open."""

    def close(self) -> None:
        """Give back what outlives a port."""


class ThreadedTransport:
    """A `Transport` over the ports of an endpoint.

    It reads in small slices, between which commands leave, and no more than its `Ration`: what a
    flood sends beyond that waits in the port, or is lost there. Frames that wait when the link is
    lost are dropped, so that no old command is sent after it returns.

    `endpoint`: opens the port, at first and after each loss (back-off 0.05 s doubling to 0.5 s).
    `ration`: what may be read; the usual one if not given.
    """

    def __init__(self, endpoint: Endpoint, ration: Ration | None = None) -> None:
        self.endpoint = endpoint
        self.counters, self.last_error = dict.fromkeys(COUNTERS, 0), ""
        self._lock, self._queue, self._sending = threading.Lock(), deque[bytes](), memoryview(b"")
        self._port: Port | None = None
        self._thread: threading.Thread | None = None
        self._on_bytes: OnBytes = lambda data, stamp: None
        self._wake_read = self._wake_write = -1
        self._backoff, self._was_open, self._closing = BACKOFF_FIRST, False, False
        self._ration = ration or Ration()

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        return self._port is not None

    def start(self, on_bytes: OnBytes) -> None:
        """Open the port here, so that the caller gets the error, and start the thread."""
        if self._closing or self._thread is not None:
            raise LinkError("this link was started before: open a new one")
        self._on_bytes = on_bytes
        port = self.endpoint.open()
        self._wake_read, self._wake_write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._port, self._was_open = port, port is not None
        self._thread = threading.Thread(target=self._run, name="bridge-io", daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> bool:
        """Queue one whole frame and wake the thread; the newest 32 wait."""
        with self._lock:
            if self._port is None or self._closing:
                self.counters["refused_writes"] += 1
                return False
            if len(self._queue) >= QUEUE_FRAMES:
                self._queue.popleft()
                self.counters["dropped_frames"] += 1
            self._queue.append(bytes(data))
            self._wake()
        return True

    def close(self) -> None:
        """Stop the thread, which closes the port."""
        with self._lock:
            if self._closing:
                return
            self._closing = True
            if self._thread is not None:
                self._wake()
        if self._thread is None:
            self.endpoint.close()
        elif self._thread is not threading.current_thread():
            self._thread.join()

    def _wake(self) -> None:
        try:
            os.write(self._wake_write, b"\0")
        except BlockingIOError:
            pass  # a full pipe wakes the thread as well

    def _run(self) -> None:
        try:
            while not self._closing:
                was_open = self.connected
                try:
                    self._turn()
                    continue
                except OSError as error:
                    self._down(str(error))
                except Exception as error:  # a bug in a callback counts as a lost link
                    self._down(f"{type(error).__name__}: {error}")
                if not was_open:  # a door that cannot be opened stays ready: do not spin on it
                    self._poll(None, None, BACKOFF_LAST)
            if self._port is not None:
                self._send(self._port)  # the last words, as far as the port takes them at once
        except OSError as error:
            self.last_error = str(error)
        finally:
            with self._lock:
                self._closing = True
                port, self._port = self._port, None
                os.close(self._wake_read)
                os.close(self._wake_write)
            if port is not None:
                port.close()
            self.endpoint.close()

    def _turn(self) -> None:
        """Wait for one event and deal with it."""
        if (port := self._port) is None:
            self._reopen()
            return
        rest, door = self._ration.rest(), self.endpoint.fileno()
        ready = self._poll(port.fileno(), door, rest or None, reading=not rest)
        if door in ready:
            self.endpoint.turn_away()
        if ready.get(port.fileno(), 0) & READABLE:
            self._ration.begin()
            if data := port.read():
                self.counters["bytes_in"] += len(data)
                self._on_bytes(data, time.monotonic())
            self._ration.end(len(data))
        self._send(port)

    def _poll(
        self, port: int | None, door: int | None, timeout: float | None, reading: bool = True
    ) -> dict[int, int]:
        """Wait for something to do; gives the events of each descriptor that has any."""
        poll = select.poll()
        poll.register(self._wake_read, select.POLLIN)
        if door is not None:
            poll.register(door, select.POLLIN)
        wanted = (READABLE if reading else 0) | (select.POLLOUT if self._sending else 0)
        if port is not None and wanted:
            poll.register(port, wanted)
        ready = dict(poll.poll(None if timeout is None else timeout * 1000.0))
        if self._wake_read in ready:
            os.read(self._wake_read, 4096)
        return ready

    def _send(self, port: Port) -> None:
        while True:
            if not self._sending:
                with self._lock:
                    if not self._queue:
                        return
                    self._sending = memoryview(self._queue.popleft())
            count = port.write(self._sending)
            self.counters["bytes_out"] += count
            self._sending = self._sending[count:]
            if self._sending:
                return

    def _reopen(self) -> None:
        door = self.endpoint.fileno()
        self._poll(None, door, self._backoff if door is None else None)
        if self._closing:
            return
        self._backoff = min(2.0 * self._backoff, BACKOFF_LAST)
        try:
            port = self.endpoint.open()
        except LinkError as error:  # still gone: no new loss to count
            self.last_error = str(error)
            return
        if port is not None:
            with self._lock:
                self.counters["reconnects"] += self._was_open
                self._port, self._was_open, self._backoff = port, True, BACKOFF_FIRST

    def _down(self, why: str) -> None:
        self.last_error = why
        self.counters["errors"] += 1
        with self._lock:
            port, self._port = self._port, None
            self.counters["dropped_frames"] += len(self._queue) + bool(self._sending)
            self._queue.clear()
            self._sending = memoryview(b"")
        if port is not None:
            port.close()
