"""The last plan, one period later, as the start of the next solve, if it is worth anything."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.input_checks import POSITION_LIMIT
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.trajectory import Trajectory, shifted
from kmpc_lite.control.options import SolverOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.types import Array

ROUNDING = 1e-9
"""By which a command may pass its bound."""
FARTHEST = 2 * POSITION_LIMIT
"""From the robot, in its own units, and in its turns [rad]: a plan that leads farther is spoilt."""


class WarmStart:
    """Judges whether the last plan is a start for the next.

    Parameters
    ----------
    problem : NavigationProblem
        Robot radius and command bounds.
    qp : NavigationQP
        Shifts multipliers.
    options : SolverOptions
        How far from the plan a robot is lost.
    """

    def __init__(
        self, problem: NavigationProblem, qp: NavigationQP, options: SolverOptions
    ) -> None:
        self._qp = qp
        self._lost_position = options.lost_position * unit_length(problem)
        self._lost_heading = options.lost_heading
        self._largest_command = max(fastest(problem)) + ROUNDING

    def from_last(self, last: Trajectory | None, here: Array) -> Trajectory | None:
        """Last plan, one period later, if the robot is where that plan put it.

        Parameters
        ----------
        last : Trajectory, optional
            The last plan.
        here : ndarray
            Present pose (3,), its heading within one turn.

        Returns
        -------
        Trajectory or None
            None for a plan that is stale, or spoilt by whoever got it.
        """
        if last is None:
            return None
        dx, dy, turned = (last.states[1] - here).tolist()
        turns = nearest_turn(turned) if abs(turned) <= POSITION_LIMIT else 0.0
        # also false for NaN
        is_near = abs(dx) <= self._lost_position and abs(dy) <= self._lost_position
        if not (is_near and abs(turned - turns) <= self._lost_heading):
            return None
        guess = shifted(self._qp, last, here)
        # also false for NaN
        if not (
            np.maximum.reduce(np.abs(guess.states - here), axis=None) <= FARTHEST
            and np.maximum.reduce(np.abs(guess.inputs), axis=None) <= self._largest_command
            and math.isfinite(np.add.reduce(guess.duals))
        ):
            return None
        if turns:
            guess.states[1:, 2] -= turns
        return guess
