"""What watchers are shown: the newest of everything, as JSON, made once for all of them."""

from __future__ import annotations

import json
import math
import time
from array import array
from collections import deque
from collections.abc import Callable
from typing import Any

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
