"""The newest of everything that is shown, as JSON, and who waits for changes of it."""

from __future__ import annotations

import json
import math
import threading
import time
from array import array
from collections import deque
from collections.abc import Callable
from typing import Any

PATIENCE = 1.0  # how long the drive may take to obey a button [s]
DIGITS = 4  # numbers are shown to a tenth of a millimetre
LONGEST_TEXT = 500
LONGER = {"cells": 100_000}  # longest texts of some names: a grid's cells, which come as one
TRAIL, STEP = 2000, 0.02  # poses of the driven path that are kept, so far apart [m]


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
    """The newest value under each name, and the path that was driven; threads may share it."""

    def __init__(self) -> None:
        self._parts: dict[str, str] = {}  # JSON of each value
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self._news = threading.Condition(threading.RLock())
        self._taken = time.monotonic()
        self._change = "{}"
        self.version = 0  # how many packets came
        self.values: dict[str, Any] = {}  # as they came
        self.over = ""  # how the drive ended, once it has

    def take(self, packet: dict[str, Any]) -> str:
        """Take new values; gives the JSON of those that have changed."""
        parts = {
            name: json.dumps(plain(value), separators=(",", ":"), allow_nan=False)
            for name, value in packet.items()
        }
        with self._news:
            changed = {n: part for n, part in parts.items() if self._parts.get(n) != part}
            self._parts.update(changed)
            self.values.update(packet)
            self.over = str(packet.get("over", self.over))
            if packet.get("pose"):
                self._follow(*packet["pose"][:2])
            self._change = _object(changed)
            self.version += 1
            self._taken = time.monotonic()
            self._news.notify_all()
            return self._change

    def since(self, version: int, patience: float) -> tuple[str, int]:
        """Wait for what is newer than a version (0: everything), as JSON, and give its version.

        Who was slow gets everything, who waited in vain how long nothing has come [s].
        """
        with self._news:
            if version and not self._news.wait_for(lambda: self.version > version, patience):
                return f'{{"silence":{time.monotonic() - self._taken:.1f}}}', version
            one_behind = version and self.version == version + 1
            return self._change if one_behind else self.whole(), self.version

    def wait_until(self, obeyed: Callable[[dict[str, Any]], bool]) -> bool:
        """Wait `PATIENCE` for values that hold, and tell whether they do."""
        with self._news:
            return self._news.wait_for(lambda: obeyed(self.values), PATIENCE)

    def whole(self) -> str:
        """Give the JSON of all values, and of the path driven so far."""
        with self._news:
            trail = json.dumps([plain(number) for place in self._trail for number in place])
            return _object({**self._parts, "trail": trail})

    def _follow(self, x: float, y: float) -> None:
        if not (math.isfinite(x) and math.isfinite(y)):
            return
        if not self._trail or math.dist(self._trail[-1], (x, y)) >= STEP:
            self._trail.append((x, y))


def _object(parts: dict[str, str]) -> str:
    return "{" + ",".join(f"{json.dumps(name)}:{part}" for name, part in parts.items()) + "}"
