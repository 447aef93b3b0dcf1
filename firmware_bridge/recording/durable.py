"""A file that grows by whole records while a robot drives.

Nothing here can stop a robot: records go into a bounded queue, and a thread of the file's own
writes and syncs them. On a full disk they wait for room; what is lost in the end is counted.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Generic, TypeVar

from firmware_bridge.messages import ConfigError

T = TypeVar("T")
WRITE_PERIOD = 0.25  # between writes [s]
SYNC_PERIOD = 0.5
"""Between syncs to the disk [s]: with what waits for its turn, a power cut costs less than the last
second."""
QUEUE = 100_000  # records that may wait for the disk


class DurableFile(Generic[T]):
    """A new file that grows by whole records, from any thread.

    `path`: must not exist: a log is never written over. `encode`: records to the pieces that stand
    in the file, each of them whole or not there; called in the writing thread. `header`: first
    bytes of the file. Raises ConfigError if the file exists or cannot be made.
    """

    def __init__(
        self, path: Path, encode: Callable[[Iterable[T]], list[bytes]], header: bytes = b""
    ) -> None:
        self.path, self._encode = path, encode
        try:
            self._descriptor = os.open(
                path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o644
            )
        except FileExistsError as error:
            raise ConfigError(
                f"{path}: exists already: choose another name, or remove it"
            ) from error
        except OSError as error:
            raise ConfigError(f"{path}: cannot write: {error.strerror or error}") from error
        self._queue: deque[T] = deque()
        self._waiting: deque[bytes] = deque([header] if header else [])
        """Pieces that are not in the file yet."""
        self._quit = threading.Event()
        self._trouble = self._ended = ""
        self.dropped = 0  # records that were lost: the disk was too slow, or full
        self.size = 0  # bytes of whole records in the file, the header among them
        self.written = -len(self._waiting)  # records in the file
        self._write()
        self._thread = threading.Thread(
            target=self._run, name=f"bridge-log-{path.suffix}", daemon=True
        )
        self._thread.start()

    @property
    def problem(self) -> str:
        """What is wrong with the log; closing it reports how much is lost."""
        lost = f"{self.dropped} records are lost" if self._quit.is_set() and self.dropped else ""
        if self._ended:
            return ": ".join(filter(None, (self._ended, lost)))
        if self._trouble:
            what = lost or "records wait for room; the robot drives on"
            return f"{self.path}: {self._trouble}: {what}"
        if self.dropped:
            return f"{self.path}: {lost or 'records are lost'}: the disk is too slow, or was full"
        return ""

    def put(self, record: T) -> None:
        """Add a record; returns at once and never raises."""
        if self._ended or len(self._queue) + len(self._waiting) >= QUEUE:
            self.dropped += 1
        else:
            self._queue.append(record)

    def close(self) -> None:
        """Write what waits and close; idempotent."""
        if not self._quit.is_set():
            self._quit.set()
            self._thread.join()
            os.close(self._descriptor)

    def discard_if_empty(self) -> None:
        """Remove a closed file into which no record came."""
        if self.written <= 0:
            self.path.unlink(missing_ok=True)

    def _run(self) -> None:
        synced, due = time.monotonic(), False
        while True:
            last = self._quit.wait(WRITE_PERIOD)
            self._take([self._queue.popleft() for _ in range(len(self._queue))])
            due = self._write() or due
            if due and (last or time.monotonic() - synced >= SYNC_PERIOD):
                synced, due = time.monotonic(), False
                self._sync()
            if last:
                self.dropped += len(self._waiting)
                self._waiting.clear()
                return

    def _take(self, records: list[T]) -> None:
        """Make pieces of records."""
        if not records or self._ended:
            self.dropped += len(records)
            return
        try:
            self._waiting.extend(self._encode(records))
        except Exception as error:  # a log that cannot be made sense of must not end the drive
            self.dropped += len(records)
            self._ended = f"{self.path}: {type(error).__name__}: {error}: logging has ended"

    def _write(self) -> bool:
        """Append what waits, as much as there is room for; whether anything went into the file."""
        data, done = memoryview(b"".join(self._waiting)), 0
        try:
            while done < len(data):
                done += os.write(self._descriptor, data[done:])
            self._trouble = ""
        except OSError as error:
            self._trouble = error.strerror or str(error)
        whole = 0
        while self._waiting and whole + len(self._waiting[0]) <= done:
            whole += len(self._waiting.popleft())
            self.written += 1
        self.size += whole
        if whole < done:
            self._cut()
        return whole > 0

    def _cut(self) -> None:
        """Take back the piece that a full disk cut short."""
        try:
            os.ftruncate(self._descriptor, self.size)
        except OSError as error:  # nothing may follow: readers know how to stop at a torn record
            self._ended = f"{self.path}: {error.strerror or error}: logging has ended"

    def _sync(self) -> None:
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            self._trouble = error.strerror or str(error)
