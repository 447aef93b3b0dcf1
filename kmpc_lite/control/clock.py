"""Time: laps and deadlines of a step, the only ones that look at a clock, and what lately was."""

from __future__ import annotations

import math
from collections.abc import Callable

LEAST_AFTER_SOLVE = 5e-5  # time that a step takes after its plan is verified [s]
FORGETTING = 0.95
"""Factor by which the remembered time shrinks with each newer one: twenty quick ones take two
thirds of it. Counted, not timed: how rarely work is late hangs on how often it is done."""


class StepClock:
    """Laps of one step.

    `clock`: gives the time [s]. `budget`: longest that the step may take [s].
    """

    def __init__(self, clock: Callable[[], float], budget: float | None) -> None:
        self._clock, self._budget = clock, budget
        self._start = self._last = clock()
        self._phases: dict[str, float] = {}

    def lap(self, phase: str) -> float:
        """End a phase, and return how long it has taken [s]."""
        now = self._clock()
        took, self._last = now - self._last, now
        self._phases[phase] = took
        return took

    def add(self, phases: dict[str, float]) -> None:
        """Take in phases that were measured elsewhere."""
        self._phases.update(phases)
        self._last = self._clock()

    def after(self, share: float) -> float:
        """Time at which a share of the budget is used up [s]; infinite without one."""
        return math.inf if self._budget is None else self._start + share * self._budget

    def timing(self) -> dict[str, float]:
        """Seconds by phase, and ``total``."""
        return {**self._phases, "total": self._clock() - self._start}


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
