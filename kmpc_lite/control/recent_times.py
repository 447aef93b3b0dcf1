"""How long something takes: what a step leaves free for work that is still to come."""

from __future__ import annotations

FORGETTING = 0.95
"""Factor by which the remembered time shrinks with each newer one: twenty quick ones take two
thirds of it. Counted, not timed: how rarely work is late hangs on how often it is done."""


def longest_lately(before: float, took: float) -> float:
    """Longest of the recent times [s]: it grows at once and shrinks slowly.

    Parameters
    ----------
    before : float
        What this function returned for the time before [s].
    took : float
        The newest time [s].

    Examples
    --------
    >>> longest_lately(0.002, 0.005), round(longest_lately(0.002, 0.001), 6)
    (0.005, 0.0019)
    """
    return max(took, FORGETTING * before)
