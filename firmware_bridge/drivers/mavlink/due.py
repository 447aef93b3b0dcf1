"""Periodic jobs: when each is due next."""

from __future__ import annotations

import math


class Due:
    """Remembers when each job is due next.

    Examples
    --------
    >>> due = Due()
    >>> due("heartbeat", 5.0, 1.0), due("heartbeat", 5.5, 1.0), due("heartbeat", 6.0, 1.0)
    (True, False, True)
    """

    def __init__(self) -> None:
        self._next: dict[str, float] = {}

    def __call__(self, what: str, now: float, period: float) -> bool:
        """Whether a job is due at `now` [s]; if so, it is due again `period` [s] later."""
        if now < self._next.get(what, -math.inf):
            return False
        self._next[what] = now + period
        return True
