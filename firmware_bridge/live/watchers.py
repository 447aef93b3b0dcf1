"""Browsers that watch, and the newest of everything, as JSON made once for all of them.

Each gets the newest as fast as it takes it, and none waits for another.
"""

from __future__ import annotations

import asyncio
import json
import math
import socket
import time
from array import array
from collections import deque
from collections.abc import Callable
from typing import Any

PATIENCE, POLL = 1.0, 0.02
"""How long the drive may take to obey a button, and how often that is looked at [s]."""
DIGITS = 4
"""Numbers are shown to a tenth of a millimetre."""
LONGEST_TEXT = 500
LONGER = {"cells": 100_000}
"""Longest texts of some names: a grid's cells, which come as one."""
TRAIL, STEP = 2000, 0.02
"""Poses of the driven path that are kept, so far apart [m]."""


def plain(value: Any, longest: int = LONGEST_TEXT) -> Any:
    r"""Make a value of a packet one that JSON has: arrays lists, what is not finite None.

    Examples
    --------
    >>> plain({"x": array("d", [1.0, math.inf]).tobytes(), "y": math.nan, "z": "a\tb"})
    {'x': [1.0, None], 'y': None, 'z': 'a?b'}
    """
    if isinstance(value, bytes):
        numbers = array("d")
        numbers.frombytes(value)
        return [plain(number) for number in numbers]
    if isinstance(value, float):
        return round(value, DIGITS) if math.isfinite(value) else None
    if isinstance(value, str):
        shown = "".join(c if c.isprintable() else "?" for c in value[:longest])
        return shown if len(value) <= longest else shown + " ..."
    if isinstance(value, dict):
        return {
            str(name): plain(entry, LONGER.get(name, LONGEST_TEXT)) for name, entry in value.items()
        }
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return value


class Picture:
    """The newest value under each name, and the path that was driven.

    Parameters
    ----------
    clock : callable
        Monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._parts: dict[str, str] = {}
        """JSON of each value."""
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self._taken = clock()
        self.values: dict[str, Any] = {}
        """As they came."""
        self.over = ""
        """How the drive ended, once it has."""

    @property
    def age(self) -> float:
        """Time since the last packet [s]."""
        return self._clock() - self._taken

    def take(self, packet: dict[str, Any]) -> str:
        """Take new values; gives the JSON of those that have changed."""
        self._taken = self._clock()
        changed = {}
        for name, value in packet.items():
            part = json.dumps(plain(value), separators=(",", ":"), allow_nan=False)
            if self._parts.get(name) != part:
                self._parts[name] = changed[name] = part
        self.values.update(packet)
        self.over = str(packet.get("over", self.over))
        if packet.get("pose"):
            self._follow(*packet["pose"][:2])
        return _object(changed)

    def wait_until(self, obeyed: Callable[[dict[str, Any]], bool]) -> bool:
        """Wait `PATIENCE` for values that hold, and tell whether they do."""
        until = time.monotonic() + PATIENCE
        while not (holds := obeyed(self.values)) and time.monotonic() < until:
            time.sleep(POLL)
        return holds

    def whole(self) -> str:
        """Give the JSON of all values, and of the path driven so far."""
        trail = json.dumps([plain(number) for place in self._trail for number in place])
        return _object({**self._parts, "trail": trail})

    def _follow(self, x: float, y: float) -> None:
        if not (math.isfinite(x) and math.isfinite(y)):
            return
        if not self._trail or math.dist(self._trail[-1], (x, y)) >= STEP:
            self._trail.append((x, y))


def _object(parts: dict[str, str]) -> str:
    return "{" + ",".join(f"{json.dumps(name)}:{part}" for name, part in parts.items()) + "}"


MOST = 128
"""More watchers than this are turned away."""
BUFFER = 65536
"""Of the kernel's, for one watcher [bytes]: what waits there is old."""
STUCK = 5.0
"""A watcher that has taken nothing for so long is dropped [s]."""


class Watcher:
    """One stream of events."""

    def __init__(self, writer: asyncio.StreamWriter, now: float) -> None:
        self._writer, self._since = writer, now
        self.behind = True
        """Whether it has missed a change: it gets everything next."""
        peer = writer.get_extra_info("socket")
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)

    def offer(self, text: str, now: float) -> bool:
        """Send an event if the last one has left; False if the watcher is stuck or gone."""
        transport = self._writer.transport
        if transport.is_closing():
            return False
        if transport.get_write_buffer_size():
            self.behind = True
            if now - self._since > STUCK:
                transport.abort()
                return False
            return True
        self._since = now
        self._writer.write(f"data: {text}\n\n".encode())
        return True


class Watchers:
    """All streams.

    Parameters
    ----------
    picture : Picture
        What they are shown.
    """

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._all: set[Watcher] = set()

    def __len__(self) -> int:
        return len(self._all)

    def add(self, writer: asyncio.StreamWriter) -> Watcher | None:
        """Take one more, and show it everything; None if there are too many."""
        if len(self._all) >= MOST:
            return None
        watcher = Watcher(writer, time.monotonic())
        self._all.add(watcher)
        self._show(watcher, "", self._picture.whole())
        return watcher

    def remove(self, watcher: Watcher) -> None:
        """Forget one that has gone."""
        self._all.discard(watcher)

    def tell(self, change: str) -> None:
        """Show all of them a change."""
        whole = ""
        for watcher in list(self._all):
            if watcher.behind and not whole:
                whole = self._picture.whole()
            self._show(watcher, change, whole)

    def _show(self, watcher: Watcher, change: str, whole: str) -> None:
        was_behind, watcher.behind = watcher.behind, False
        if not watcher.offer(whole if was_behind else change, time.monotonic()):
            self._all.discard(watcher)
