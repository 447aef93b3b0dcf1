"""What lately was: running means that last for a time, and how long work takes."""

from __future__ import annotations

FORGETTING = 0.95
"""Factor by which the remembered time shrinks with each newer one: twenty quick ones take two
thirds of it. Counted, not timed: how rarely work is late hangs on how often it is done."""


def longest_lately(before: float, took: float) -> float:
    """Longest of the recent times [s], of what it was `before`: grows at once, shrinks slowly.

    Examples
    --------
    >>> longest_lately(0.002, 0.005), round(longest_lately(0.002, 0.001), 6)
    (0.005, 0.0019)
    """
    return max(took, FORGETTING * before)


def newest_weight(memory: float, period: float, longest: float) -> float:
    """Weight of the newest value in a running mean.

    `memory`: for how long values count [s]; where that is shorter than a period, the newest alone
    does. `period`: between two values [s]. `longest`: period that a longer one counts as [s], so
    that a mean keeps as many values as with this.

    Examples
    --------
    >>> [newest_weight(0.5, *times) for times in ((0.1, 0.1), (0.02, 0.1), (1.0, 0.1), (1.0, 2.0))]
    [0.2, 0.04, 0.2, 1.0]
    """
    return min(min(period, longest) / memory, 1.0)
