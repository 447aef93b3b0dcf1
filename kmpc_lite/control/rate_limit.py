"""How far a command may be from the one before it."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

ROUNDING = 1.0 + 1e-9
"""A change that is larger than allowed by less than this factor is the largest one allowed."""


class RateLimit:
    """Limits on the change of commands from one period to the next.

    Parameters
    ----------
    problem : NavigationProblem
        `du_max`, `deceleration`, and the period.

    Attributes
    ----------
    active : bool
        Whether anything is limited.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self.active = problem.limits_changes
        self._within = problem.wheels.within
        self._dt, self._change = problem.dt, problem.dt * problem.du_max
        self._brake = problem.dt * np.maximum(problem.du_max, problem.deceleration)
        if self.active:
            steps = np.arange(1, problem.horizon + 1)[:, None]
            self._reach = steps * self._change

    def limit(self, command: Array, last: Array) -> Array:
        """Go from the last command (2,) towards a new one (2,) as far as is allowed.

        Speed and turn rate change by one share. A speed that shrinks may do so at the problem's
        deceleration where that is more.
        """
        change = command - last
        allowed = np.where(
            change * last < 0.0,
            np.maximum(self._change, np.minimum(self._brake, np.abs(last))),
            self._change,
        )
        size = np.abs(change)
        over = size > allowed * ROUNDING
        if not over.any():
            return command
        limited = last + float((allowed[over] / size[over]).min()) * change
        return self._within(limited)

    def first(self, last: Array) -> tuple[Array, Array]:
        """Least and largest first command of a plan, (2,) each."""
        return last - self._change, last + self._change

    def in_reach(self, inputs: Array, last: Array) -> Array:
        """Bring the commands of a guess (N, 2) as near to the last command (2,) as they must be.

        Zeros become a braking ramp.
        """
        return np.clip(inputs, last - self._reach, last + self._reach)
