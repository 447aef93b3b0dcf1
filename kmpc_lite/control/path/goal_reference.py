"""The goal itself as the reference, as in the paper: what is steered for without guidance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import wrap
from kmpc_lite.types import STATES, Array


@dataclass(slots=True)
class GoalReferenceState:
    """What is remembered from step to step."""

    turn: float = 0.0
    """Signed turn to the goal's heading in the step before [rad]."""


class GoalReference:
    """Holds the side to which the robot turns towards the goal's heading.

    Parameters
    ----------
    problem : NavigationProblem
        Horizon.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._states = np.empty((problem.horizon + 1, STATES))

    def reference(self, state: GoalReferenceState, here: Array, goal: Array) -> Array:
        """States (N + 1, 3) to steer for from a pose (3,); overwritten by the next call."""
        turn = wrap(float(goal[2] - here[2]))
        before = state.turn
        # near a half turn, the side of the step before is kept
        if abs(turn) > 0.75 * math.pi and turn * before < 0.0 and abs(before) > 0.5 * math.pi:
            turn -= math.copysign(math.tau, turn)
        state.turn = turn
        self._states[:] = goal
        self._states[:, 2] = here[2] + turn
        return self._states
