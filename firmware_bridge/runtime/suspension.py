"""Whether the computer was asleep: the monotonic clock, by which all stamps go, does not tell."""

from __future__ import annotations

import time
from collections.abc import Callable

CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""Goes on while the computer sleeps, on Linux; where there is none, nothing tells of sleep."""
SHORTEST = 0.5
"""Less sleep than this is none [s]."""


def asleep() -> float:
    """How long the computer has been suspended since it was switched on [s]."""
    return time.clock_gettime(CLOCK) - time.monotonic()


class Suspension:
    """Tells once of each time in which the computer slept.

    Parameters
    ----------
    asleep : callable
        How long it has slept in all [s].

    Examples
    --------
    >>> slept = [0.0]
    >>> suspension = Suspension(lambda: slept[0])
    >>> slept[0] = 3600.0
    >>> suspension.happened(), suspension.happened()
    (True, False)
    """

    def __init__(self, asleep: Callable[[], float] = asleep) -> None:
        self._asleep, self._before = asleep, asleep()

    def happened(self) -> bool:
        """Whether it slept since the last call."""
        before, self._before = self._before, self._asleep()
        return self._before - before > SHORTEST
