"""How late a robot answers: a dead time and a time constant, as weights of past commands.

Free weights for every lag would come out jagged, since commands in a log change rarely; a response
of two numbers is smooth.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import Array

DEAD_TIMES = (0.0, 1.0, 2.0, 3.0, 5.0)
"""Dead times that are tried first [periods]."""
TIME_CONSTANTS = (0.0, 0.5, 1.0, 2.0, 3.5)
"""Time constants that are tried first [periods]."""
SETTLED = 3.0
"""Time constants after which a response counts as settled: 95 % of its final value."""


class Response(NamedTuple):
    """Answer of one motor: nothing for `dead_time`, then exponentially towards the command."""

    dead_time: float
    """[s]."""
    time_constant: float
    """[s]."""

    @property
    def delay(self) -> float:
        """Mean delay [s]: how far behind its commands the robot drives."""
        return self.dead_time + self.time_constant

    def described(self) -> list[float]:
        """Dead time and time constant [s]."""
        return list(self)

    def weights(self, dt: float, longest: int) -> tuple[float, ...]:
        """Weights of the present and at most `longest` past commands, newest first; of sum one.

        Each is the share of a command held for one period [s] that acts within a later period.
        """
        ages = min(longest, ceil((self.dead_time + SETTLED * self.time_constant) / dt - 1e-9))
        since = np.maximum(np.arange(ages + 2) * dt - self.dead_time, 0.0)
        travelled = since
        if self.time_constant > 0.0:
            travelled = since + self.time_constant * np.expm1(-since / self.time_constant)
        answered: Array = np.diff(np.diff(travelled) / dt, prepend=0.0)
        # what would act later than the longest history counts as acting with the oldest command
        answered[-1] += 1.0 - answered.sum()
        return tuple(float(k) for k in answered)


AT_ONCE = Response(0.0, 0.0)
"""A robot that obeys at once."""


def first_candidates(dt: float, longest: int) -> tuple[Response, ...]:
    """Responses that are tried first, `AT_ONCE` leading, within a history of `longest` periods."""
    pairs = [Response(d * dt, t * dt) for d in DEAD_TIMES for t in TIME_CONSTANTS]
    return tuple(r for r in pairs if _fits(r, dt, longest))


def neighbours(response: Response, step: float, dt: float, longest: int) -> tuple[Response, ...]:
    """Responses a step [s] away, within a history of `longest` periods."""
    ways = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1))
    dead, constant = response
    found = [Response(dead + i * step, constant + j * step) for i, j in ways]
    return tuple(r for r in found if min(r) >= 0.0 and _fits(r, dt, longest))


def _fits(response: Response, dt: float, longest: int) -> bool:
    """Whether a history of `longest` periods [s] holds most of a response."""
    dead, constant = response
    return dead <= longest * dt and dead + 2.0 * constant <= (longest + 1) * dt
