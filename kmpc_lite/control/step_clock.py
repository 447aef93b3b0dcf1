"""Time within a step: the only place, beside its deadlines, where a step looks at a clock."""

from __future__ import annotations

import math
from collections.abc import Callable

LEAST_AFTER_SOLVE = 5e-5
"""Time that a step takes after its plan is verified [s]."""


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
