"""Real time on a small board: process set-up, absolute deadlines, statistics that do not grow."""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import ProblemError

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
BINS_PER_DECADE = 200
"""Resolution of a `Histogram`: 1.2 %."""
DECADES = (-7, 2)


def prepare_process(cpu: int | None = None, priority: int | None = 50) -> list[str]:
    """Make this process fit for a control loop; say what was done and what was not permitted.

    Freezes the garbage collector's view of what exists, pins to a core, asks for SCHED_FIFO. BLAS
    threads cannot be changed once NumPy is loaded: a note says if the environment had not limited
    them.

    Parameters
    ----------
    cpu : int, optional
        Core to pin to; none where not given.
    priority : int, optional
        Of SCHED_FIFO, 1 to 99; None leaves the scheduler alone.

    Returns
    -------
    list of str
        One line for each measure.
    """
    told = []
    gc.collect()
    gc.freeze()
    told.append("garbage collector: everything that exists is frozen")
    limited = [name for name in THREAD_VARIABLES if os.environ.get(name) == "1"]
    advice = f"not limited; set {' or '.join(THREAD_VARIABLES)} to 1 before Python starts"
    told.append(f"BLAS threads: {'1' if limited else advice}")
    if cpu is not None:
        try:
            os.sched_setaffinity(0, {cpu})
            told.append(f"pinned to core {cpu}")
        except (AttributeError, OSError) as error:
            told.append(f"not pinned to core {cpu}: {error}")
    if priority is not None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            told.append(f"scheduler: SCHED_FIFO, priority {priority}")
        except (AttributeError, OSError) as error:
            told.append(f"scheduler: ordinary, SCHED_FIFO not permitted ({error})")
    return told


class Histogram:
    """Distribution of times in logarithmic bins of 1.2 %: any number of samples in fixed memory.

    Examples
    --------
    >>> times = Histogram()
    >>> for microseconds in range(1, 1001):
    ...     times.add(1e-6 * microseconds)
    >>> 494 <= 1e6 * times.percentile(50) <= 506
    True
    """

    def __init__(self) -> None:
        self.counts = np.zeros((DECADES[1] - DECADES[0]) * BINS_PER_DECADE + 1, dtype=np.int64)
        self.count = 0
        self.largest = 0.0

    def add(self, seconds: float) -> None:
        """Count one time; below 0.1 us counts as that, above 100 s as that."""
        place = (
            0
            if seconds <= 10.0 ** DECADES[0]
            else int(BINS_PER_DECADE * (np.log10(seconds) - DECADES[0]))
        )
        self.counts[min(place, len(self.counts) - 1)] += 1
        self.count += 1
        self.largest = max(self.largest, seconds)

    def percentile(self, percent: float) -> float:
        """Time [s] that `percent` of the samples do not exceed, to 1.2 %; NaN without samples."""
        if not self.count:
            return float("nan")
        if percent >= 100:
            return self.largest
        place = int(np.searchsorted(np.cumsum(self.counts), np.ceil(percent / 100 * self.count)))
        middle = 10.0 ** ((place + 0.5) / BINS_PER_DECADE + DECADES[0])
        return float(min(middle, self.largest))

    def share_above(self, seconds: float) -> float:
        """Share of the samples above a time [s], to the bin."""
        place = (
            0
            if seconds <= 10.0 ** DECADES[0]
            else int(BINS_PER_DECADE * (np.log10(seconds) - DECADES[0]))
        )
        return float(self.counts[place + 1 :].sum() / self.count) if self.count else 0.0

    def summary(self) -> dict[str, float]:
        """p50, p99, p99.9 and the maximum [s]."""
        return {
            "p50": self.percentile(50),
            "p99": self.percentile(99),
            "p99.9": self.percentile(99.9),
            "max": self.largest,
        }


@dataclass(frozen=True)
class Tick:
    """One period of a `DeadlineLoop`."""

    index: int
    """Of the period; skipped ones count."""
    deadline: float
    """When it was to begin [s]."""
    late: float
    """How much later it began [s]."""
    skipped: int
    """Periods that were left out just before, because the last one ran over them."""


class DeadlineLoop:
    """Begin a period at ``start + k * period``: absolute deadlines, so that errors do not add up.

    After a stall the missed periods are skipped, not made up for in a burst.

    Parameters
    ----------
    period : float
        [s].
    clock, sleep : callable
        Monotonic time [s], and waiting for a time [s].
    """

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not (np.isfinite(period) and period > 0.0):
            raise ProblemError(f"period: expected a time > 0 s, got {period!r}")
        self.period, self._clock, self._sleep = period, clock, sleep
        self.lateness = Histogram()
        self.skipped = 0

    def ticks(self, duration: float) -> Iterator[Tick]:
        """Yield once a period for so long [s]; the body of the loop is the period's work."""
        start = self._clock()
        index = 0
        while index * self.period < duration:
            deadline = start + index * self.period
            while (left := deadline - self._clock()) > 0.0:
                self._sleep(left)
            late = self._clock() - deadline
            missed = int(late // self.period)
            if missed:
                index += missed
                deadline, late = start + index * self.period, late - missed * self.period
                self.skipped += missed
                if index * self.period >= duration:
                    return
            self.lateness.add(late)
            yield Tick(index, deadline, late, missed)
            index += 1
