"""What is to be done again and again, each thing in its own period."""

from __future__ import annotations

import math


class Due:
    """Remembers when each thing is next to be done.

    Examples
    --------
    >>> due = Due()
    >>> due("heartbeat", 5.0, 1.0), due("heartbeat", 5.5, 1.0), due("heartbeat", 6.0, 1.0)
    (True, False, True)
    """

    def __init__(self) -> None:
        self._next: dict[str, float] = {}

    def __call__(self, what: str, now: float, period: float) -> bool:
        """Whether a thing is to be done now [s]; the next time is `period` [s] later."""
        if now < self._next.get(what, -math.inf):
            return False
        self._next[what] = now + period
        return True
