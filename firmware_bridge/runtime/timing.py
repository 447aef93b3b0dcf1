"""Absolute deadlines, statistics of times in constant memory, and the time the computer slept."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

POLL = 0.005  # between two looks of `listen` [s]
FLOOR = 1e-6  # shorter times count as this [s]
RATIO = 1.01  # width of a bin: percentiles are right to 1 %
BINS = int(math.log(1e9) / math.log(RATIO)) + 1


class Histogram:
    """Counts of times from 1 us to 1000 s in bins of equal ratio.

    Examples
    --------
    >>> times = Histogram()
    >>> for k in range(1, 101):
    ...     times.add(k / 1000)
    >>> round(times.quantile(0.5), 3), times.maximum
    (0.05, 0.1)
    """

    def __init__(self) -> None:
        self._bins = [0] * (BINS + 1)
        self.count = 0
        self.total = 0.0
        self.maximum = 0.0

    def add(self, seconds: float) -> None:
        """Count one time [s]; what is not finite is left out."""
        if not math.isfinite(seconds):
            return
        self._bins[self._place(seconds)] += 1
        self.count += 1
        self.total += seconds
        self.maximum = max(self.maximum, seconds)

    def quantile(self, share: float) -> float:
        """Time [s] that a `share` of all counted times do not exceed; NaN if there are none."""
        if not self.count:
            return math.nan
        rank, seen = max(1, math.ceil(share * self.count)), 0
        for index, count in enumerate(self._bins):
            seen += count
            if seen >= rank:
                return min(FLOOR * RATIO ** (index - 0.5) if index else FLOOR, self.maximum)
        return self.maximum

    def share_above(self, seconds: float) -> float:
        """Share of the counted times above a time [s], to the bin; 0 if there are none."""
        longer = sum(self._bins[self._place(seconds) + 1 :])
        return longer / self.count if self.count else 0.0

    def _place(self, seconds: float) -> int:
        """Bin of a time [s]."""
        if seconds <= FLOOR:
            return 0
        return min(BINS, 1 + int(math.log(seconds / FLOOR) / math.log(RATIO)))

    def summary(self) -> dict[str, float | int | None]:
        """Milliseconds, for people and JSON; None if nothing was counted."""
        if not self.count:
            return {"count": 0, "mean": None, "p50": None, "p99": None, "p99.9": None, "max": None}
        quantiles = {
            name: round(1e3 * self.quantile(q), 4)
            for name, q in (("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999))
        }
        return {
            "count": self.count,
            "mean": round(1e3 * self.total / self.count, 4),
            **quantiles,
            "max": round(1e3 * self.maximum, 4),
        }


class Deadlines:
    """Instants `period` apart, counted from the first: no drift, and after a stall no burst.

    `period`: [s]. `start`: first instant [s].
    """

    def __init__(self, period: float, start: float) -> None:
        self.period, self._start, self._index = period, start, 0
        self.skipped = 0  # instants that went by unused

    @property
    def next(self) -> float:
        """Instant to wait for [s]."""
        return self._start + self._index * self.period

    def advance(self, now: float) -> None:
        """Go on to the first instant after `now`."""
        following = max(self._index + 1, math.floor((now - self._start) / self.period) + 1)
        self.skipped += following - self._index - 1
        self._index = following


class Stamped(Protocol):
    """What was measured at a time."""

    @property
    def stamp(self) -> float:
        """When, by `time.monotonic()` [s]."""


S = TypeVar("S", bound=Stamped)


def listen(newest: Callable[[], S | None], seconds: float) -> tuple[S | None, Histogram, Histogram]:
    """Look for some time [s] at what comes; gives the last, gaps between two, and ages."""
    until, last, gaps, ages = time.monotonic() + seconds, None, Histogram(), Histogram()
    while (now := time.monotonic()) < until:
        found = newest()
        if found is not None and (last is None or found.stamp != last.stamp):
            ages.add(now - found.stamp)
            if last is not None:
                gaps.add(found.stamp - last.stamp)
            last = found
        time.sleep(POLL)
    return last, gaps, ages


def table(rows: Mapping[str, Histogram]) -> str:
    """Render histograms as a table in milliseconds."""
    lines = [f"{'[ms]':<34}{'count':>9}{'p50':>10}{'p99':>10}{'p99.9':>10}{'max':>10}"]
    for name, times in rows.items():
        values = times.summary()
        shown = "".join(
            f"{'-' if values[key] is None else format(values[key], '.3f'):>10}"
            for key in ("p50", "p99", "p99.9", "max")
        )
        lines.append(f"{name:<34}{times.count:>9}{shown}")
    return "\n".join(lines)


CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""Goes on while the computer sleeps, on Linux; if there is none, nothing tells of sleep."""
SHORTEST = 0.5  # less sleep than this is none [s]


def asleep() -> float:
    """How long the computer has been suspended since it was switched on [s]."""
    return time.clock_gettime(CLOCK) - time.monotonic()


class Suspension:
    """Tells once of each time in which the computer slept.

    `asleep`: how long it has slept in all [s].

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
