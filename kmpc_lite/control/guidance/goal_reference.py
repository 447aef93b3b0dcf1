"""The goal itself as the reference, as in the paper: what is steered for without guidance."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import STATES, Array


class GoalReference:
    """Holds the side to which the robot turns towards the goal's heading.

    Parameters
    ----------
    problem : NavigationProblem
        Horizon.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._states = np.empty((problem.horizon + 1, STATES))
        self.reset()

    def reset(self) -> None:
        """Forget the side."""
        self._error = 0.0

    def reference(self, here: Array, goal: Array) -> Array:
        """States (N + 1, 3) to steer for from a pose (3,); overwritten by the next call."""
        self._states[:] = goal
        self._states[:, 2] = here[2] + self._turn_to(float(goal[2] - here[2]))
        return self._states

    def _turn_to(self, error: float) -> float:
        """Signed turn to the goal's heading; near a half turn it keeps the side of the step before."""
        error = (error + math.pi) % (2 * math.pi) - math.pi
        if (
            abs(error) > 0.75 * math.pi
            and error * self._error < 0.0
            and abs(self._error) > 0.5 * math.pi
        ):
            error -= math.copysign(2 * math.pi, error)
        self._error = error
        return error
