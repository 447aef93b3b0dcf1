"""How much a reader may take in: a flood then waits, and the safety gate does not."""

from __future__ import annotations

import time
from collections.abc import Callable

SHARE = 1.0 / 3.0
"""Share of one core that taking in one link may use for long; telemetry at 40 Hz needs 0.02."""
BYTES = 1e6
"""Bytes per second that may be read for long: ten times the fastest serial line. Whatever is read
is recorded, and no flood is to fill the disk."""
BURST = 0.01
"""Work that may be done at once after a pause [s]: half a period of the gate."""


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
