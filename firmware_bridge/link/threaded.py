"""The I/O thread: it alone touches the port, keeps the newest frames, and reopens a lost port."""

from __future__ import annotations

import os
import select
import threading
import time
from collections import deque
from typing import Protocol

from firmware_bridge.link.protocol import OnBytes
from firmware_bridge.link.ration import Ration
from firmware_bridge.messages import LinkError

QUEUE_FRAMES = 32
BACKOFF_FIRST, BACKOFF_LAST = 0.05, 0.5
READABLE = select.POLLIN | select.POLLERR | select.POLLHUP | select.POLLNVAL


class Port(Protocol):
    """An open, non-blocking port."""

    def fileno(self) -> int:
        """Descriptor to poll."""
        ...

    def read(self) -> bytes:
        """Take a little of what has arrived, empty if nothing; OSError: the other end is gone."""
        ...

    def write(self, data: memoryview) -> int:
        """Bytes that the port took now, possibly 0; raises OSError when the other end is gone."""
        ...

    def close(self) -> None:
        """Give the descriptor back."""
        ...


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
    flood sends beyond that waits in the port, or is lost there.

    Parameters
    ----------
    endpoint : Endpoint
        Opens the port, at first and after each loss (back-off 0.05 s doubling to 0.5 s).
    queue : int
        Frames that wait at most; one more drops the oldest. Frames still waiting when the link is
        lost are dropped too, so that no old command is sent after it returns.
    ration : Ration, optional
        What may be read; the usual one if not given.
    """

    def __init__(
        self, endpoint: Endpoint, queue: int = QUEUE_FRAMES, ration: Ration | None = None
    ) -> None:
        self.endpoint = endpoint
        self._lock = threading.Lock()
        self._queue: deque[bytes] = deque()
        self._queue_frames = queue
        self._port: Port | None = None
        self._sending = memoryview(b"")
        self._closing = False
        self._thread: threading.Thread | None = None
        self._on_bytes: OnBytes = lambda data, stamp: None
        self._wake_read = self._wake_write = -1
        self._backoff, self._was_open = BACKOFF_FIRST, False
        self._ration = Ration() if ration is None else ration
        self._last_error = ""
        self._counters = dict.fromkeys(
            ("bytes_in", "bytes_out", "reconnects", "dropped_frames", "refused_writes", "errors"), 0
        )

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        return self._port is not None

    @property
    def counters(self) -> dict[str, int]:
        """Sums since the start."""
        return dict(self._counters)

    @property
    def last_error(self) -> str:
        """Why the link last went down."""
        return self._last_error

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
        """Queue one whole frame and wake the thread."""
        with self._lock:
            if self._port is None or self._closing:
                self._counters["refused_writes"] += 1
                return False
            if len(self._queue) >= self._queue_frames:
                self._queue.popleft()
                self._counters["dropped_frames"] += 1
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
                was_open = self._port is not None
                try:
                    self._turn()
                    continue
                except OSError as error:
                    self._down(str(error))
                except (
                    Exception
                ) as error:  # a bug in a callback must not end the thread: it counts as a lost link
                    self._down(f"{type(error).__name__}: {error}")
                if not was_open:
                    self._poll(
                        None, None, BACKOFF_LAST
                    )  # a door that cannot be opened stays ready: do not spin on it
            if self._port is not None:
                self._send()  # the last words, as far as the port takes them at once
        except OSError as error:
            self._last_error = str(error)
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
        if self._port is None:
            self._reopen()
            return
        rest = self._ration.rest()
        door = self.endpoint.fileno()
        ready = self._poll(self._port.fileno(), door, rest or None, reading=not rest)
        if door in ready:
            self.endpoint.turn_away()
        if ready.get(self._port.fileno(), 0) & READABLE:
            self._ration.begin()
            data = self._port.read()
            if data:
                self._counters["bytes_in"] += len(data)
                self._on_bytes(data, time.monotonic())
            self._ration.end(len(data))
        self._send()

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

    def _send(self) -> None:
        assert self._port is not None
        while True:
            if not self._sending:
                with self._lock:
                    if not self._queue:
                        return
                    self._sending = memoryview(self._queue.popleft())
            count = self._port.write(self._sending)
            self._counters["bytes_out"] += count
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
            self._last_error = str(error)
            return
        if port is not None:
            with self._lock:
                self._counters["reconnects"] += self._was_open
                self._port, self._was_open, self._backoff = port, True, BACKOFF_FIRST

    def _down(self, why: str) -> None:
        self._last_error = why
        self._counters["errors"] += 1
        with self._lock:
            port, self._port = self._port, None
            self._counters["dropped_frames"] += len(self._queue) + bool(self._sending)
            self._queue.clear()
            self._sending = memoryview(b"")
        if port is not None:
            port.close()
