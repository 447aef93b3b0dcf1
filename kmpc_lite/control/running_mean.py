"""Running means that last for a time, whatever the period."""

from __future__ import annotations


def newest_weight(memory: float, period: float, longest: float) -> float:
    """Weight of the newest value in a running mean.

    Parameters
    ----------
    memory : float
        For how long values count [s]; where that is shorter than a period, the newest alone does.
    period : float
        Between two values [s].
    longest : float
        Period that a longer one counts as [s], so that a mean keeps as many values as with this.

    Examples
    --------
    >>> newest_weight(0.5, 0.1, 0.1), newest_weight(0.5, 0.02, 0.1), newest_weight(0.5, 1.0, 0.1)
    (0.2, 0.04, 0.2)
    >>> newest_weight(0.5, 1.0, 2.0)
    1.0
    """
    return min(min(period, longest) / memory, 1.0)
