"""A wire inside the process: frames both ways suffer faults that a seed repeats."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakValueDictionary

from firmware_bridge.link import OnBytes
from firmware_bridge.messages import LinkError

INBOX_FRAMES = 256


@dataclass(frozen=True)
class Faults:
    """What happens to frames on their way: probabilities per frame, and times [s]."""

    drop: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0  # one to three bytes changed
    reorder: float = 0.0  # held back until the next frame has passed
    split: float = 0.0  # arrives in two to four pieces
    cut: float = 0.0  # the cable comes out in the middle of the frame, for `cut_for`
    cut_for: float = 0.1
    delay: float = 0.0  # each frame is late by up to this much; order is kept


class FaultyPath:
    """One direction of a wire: the same frames in the same order suffer the same."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._held: bytes | None = None
        self._due = -float("inf")
        self.faults = 0  # how many faults there were

    def forget(self) -> None:
        """Lose the frame that is held back."""
        self._held = None

    def through(
        self, data: bytes, faults: Faults, now: float
    ) -> tuple[list[tuple[float, bytes]], bool]:
        """Send one frame at a time [s].

        Returns pieces with the time at which each arrives [s], and whether the cable came out.
        """
        draw = self._random.random
        frames = [data]
        if draw() < faults.drop:
            self.faults += 1
            return [], False
        if data and draw() < faults.corrupt:
            self.faults += 1
            damaged = bytearray(data)
            for _ in range(self._random.randint(1, 3)):
                damaged[self._random.randrange(len(damaged))] ^= self._random.randint(1, 255)
            frames = [bytes(damaged)]
        if draw() < faults.duplicate:
            self.faults += 1
            frames *= 2
        if self._held is not None:
            frames.append(self._held)
            self._held = None
        elif draw() < faults.reorder:
            self.faults += 1
            self._held, frames = frames[0], frames[1:]
        pieces: list[bytes] = []
        for frame in frames:
            if len(frame) > 1 and draw() < faults.split:
                self.faults += 1
                marks = sorted(
                    {
                        self._random.randrange(1, len(frame))
                        for _ in range(self._random.randint(1, 3))
                    }
                )
                pieces += [frame[a:b] for a, b in itertools.pairwise([0, *marks, len(frame)])]
            else:
                pieces.append(frame)
        cut = bool(data) and draw() < faults.cut
        if cut:
            self.faults += 1
            pieces = [data[: self._random.randrange(len(data))]]
        late = []
        for piece in pieces:
            self._due = max(self._due, now + faults.delay * draw())
            late.append((self._due, piece))
        return late, cut


class LoopbackEnd:
    """One end of a wire; a `Transport`."""

    def __init__(self, wire: LoopbackWire, seed: int) -> None:
        self._wire, self._path = wire, FaultyPath(seed)
        self._condition = wire.condition
        self._inbox: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._on_bytes: OnBytes | None = None
        self._thread: threading.Thread | None = None
        self._closed = False
        self._last_error = ""
        names = (
            "bytes_in",
            "bytes_out",
            "reconnects",
            "dropped_frames",
            "refused_writes",
            "errors",
        )
        self._counters = dict.fromkeys(names, 0)

    @property
    def used(self) -> bool:
        """Whether this end is started and not closed."""
        return self._on_bytes is not None and not self._closed

    @property
    def closed(self) -> bool:
        """Whether this end was closed."""
        return self._closed

    @property
    def connected(self) -> bool:
        """Whether both ends are started and the cable is in."""
        return self.used and self._wire.other(self).used and self._wire.plugged

    @property
    def counters(self) -> dict[str, int]:
        """Sums since the start; `faults` on the frames written here."""
        return {**self._counters, "faults": self._path.faults, "reconnects": self._wire.replugs}

    @property
    def last_error(self) -> str:
        """Why the link last went down."""
        return self._last_error or ("the cable was cut" if self._wire.cuts else "")

    def start(self, on_bytes: OnBytes) -> None:
        """Take frames from now on, in a thread unless the wire is pumped by hand."""
        if self._closed or self._on_bytes is not None:
            raise LinkError("this link was started before: open a new one")
        self._on_bytes = on_bytes
        if not self._wire.manual:
            self._thread = threading.Thread(target=self._run, name="bridge-loopback", daemon=True)
            self._thread.start()

    def write(self, data: bytes) -> bool:
        """Send one frame through the faults of the wire."""
        with self._condition:
            if not self.connected:
                self._counters["refused_writes"] += 1
                return False
            self._counters["bytes_out"] += len(data)
            pieces, cut = self._path.through(bytes(data), self._wire.faults, self._wire.clock())
            if cut:
                self._wire.cut(self._wire.faults.cut_for)
            self._wire.other(self).receive(pieces)
        return True

    def receive(self, pieces: list[tuple[float, bytes]]) -> None:
        """Put what the other end sent into the inbox: (due, bytes)."""
        with self._condition:
            if not self.used:
                return
            for due, data in pieces:
                if len(self._inbox) >= INBOX_FRAMES:
                    heapq.heappop(self._inbox)
                    self._counters["dropped_frames"] += 1
                heapq.heappush(self._inbox, (due, next(self._order), data))
            self._condition.notify_all()

    @property
    def pending(self) -> bool:
        """Whether something is due now."""
        return self.used and bool(self._inbox) and self._inbox[0][0] <= self._wire.clock()

    def forget(self) -> None:
        """Lose what is on the wire."""
        with self._condition:
            self._inbox.clear()
            self._path.forget()

    def deliver(self, now: float) -> float | None:
        """Hand over what is due; returns the next due time or None."""
        while True:
            with self._condition:
                if self._closed or not self._inbox:
                    return None
                if self._inbox[0][0] > now:
                    return self._inbox[0][0]
                data = heapq.heappop(self._inbox)[2]
                self._counters["bytes_in"] += len(data)
            assert self._on_bytes is not None
            try:
                self._on_bytes(data, now)
            # as in the threaded transport: counted, reported, and the link goes down for a moment
            except Exception as error:
                self._counters["errors"] += 1
                self._last_error = f"{type(error).__name__}: {error}"
                self._wire.cut(0.05)

    def close(self) -> None:
        """Stop the thread; idempotent."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        while not self._closed:
            due = self.deliver(self._wire.clock())
            with self._condition:
                if self._closed:
                    return
                if not self._inbox:
                    self._condition.wait()
                elif due is not None:
                    self._condition.wait(max(0.0, due - self._wire.clock()))


class LoopbackWire:
    """Two ends that hear each other.

    `faults`: on frames both ways. `seed`: of the faults: the same frames in the same order suffer
    the same. `manual`: without threads: nothing is delivered but by `pump`, in the caller's thread.
    `clock`: time [s]; another than `time.monotonic` needs `manual`.
    """

    def __init__(
        self,
        faults: Faults | None = None,
        seed: int = 0,
        manual: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.faults, self.manual, self.clock = faults or Faults(), manual, clock
        self.condition = threading.Condition()
        self.cuts = self.replugs = 0
        self._down_until: float | None = None
        self._seed = seed
        self.bridge, self.board = LoopbackEnd(self, 2 * seed), LoopbackEnd(self, 2 * seed + 1)

    @property
    def plugged(self) -> bool:
        """Whether the cable is in."""
        with self.condition:
            if self._down_until is not None and self.clock() >= self._down_until:
                self.heal()
            return self._down_until is None

    def other(self, end: LoopbackEnd) -> LoopbackEnd:
        """Find the end that hears `end`."""
        return self.board if end is self.bridge else self.bridge

    def take(self, board: bool) -> LoopbackEnd:
        """Return an unused end: a new one if the last user has closed it."""
        with self.condition:
            end = self.board if board else self.bridge
            if end.used:
                raise LinkError(f"loopback: the {'board' if board else 'bridge'} end is in use")
            if end.closed:
                end = LoopbackEnd(self, 2 * self._seed + board)
                if board:
                    self.board = end
                else:
                    self.bridge = end
            return end

    def cut(self, seconds: float = float("inf")) -> None:
        """Pull the cable, for a while or until `heal`; what is on the wire is lost."""
        with self.condition:
            self.cuts += 1
            self._down_until = self.clock() + seconds
            self.bridge.forget()
            self.board.forget()

    def heal(self) -> None:
        """Put the cable back."""
        with self.condition:
            if self._down_until is not None:
                self._down_until = None
                self.replugs += 1

    def pump(self) -> None:
        """Deliver all that is due now, both ways, answers included."""
        while self.bridge.pending or self.board.pending:
            self.board.deliver(self.clock())
            self.bridge.deliver(self.clock())


_WIRES: WeakValueDictionary[str, LoopbackWire] = WeakValueDictionary()
_WIRES_LOCK = threading.Lock()


def named_wire(name: str, faults: Faults | None = None, seed: int = 0) -> LoopbackWire:
    """Find or make the wire of this name in the process; `faults` are set if given."""
    with _WIRES_LOCK:
        wire = _WIRES.get(name)
        if wire is None:
            wire = _WIRES[name] = LoopbackWire(faults, seed)
        elif faults is not None:
            wire.faults = faults
        return wire


def serve_on(emulator: Any, wire: LoopbackWire) -> None:
    """Put an emulated board at the far end of a wire."""
    emulator._transport = wire.take(board=True)
    emulator._transport.start(emulator._receive)
