"""The last plan, one period on, as the start of the next solve, unless something tells that it is worth nothing."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.input_checks import POSITION_LIMIT
from kmpc_lite.control.nmpc.sqp import SQP, Trajectory
from kmpc_lite.types import Array

JUMP = (0.5, 1.0)
"""A pose that is farther from the predicted one [m, rad] makes the last plan worthless as a
start."""
ROUNDING = 1e-9
"""By which a command may pass its bound."""


def warm_start(sqp: SQP, last: Trajectory | None, here: Array) -> Trajectory | None:
    """Last plan, one period on, if the robot is where that plan put it; none for a plan that is stale or poisoned."""
    if last is None:
        return None
    dx, dy, turned = (last.states[1] - here).tolist()
    turns = 2 * np.pi * round(turned / (2 * np.pi)) if abs(turned) <= POSITION_LIMIT else 0.0
    # also false for NaN
    if not (abs(dx) <= JUMP[0] and abs(dy) <= JUMP[0] and abs(turned - turns) <= JUMP[1]):
        return None
    guess = sqp.shift(last, here)
    # also false for NaN
    if not (
        np.abs(guess.states).max() <= 2 * POSITION_LIMIT
        and np.abs(guess.inputs).max() <= sqp.largest_command + ROUNDING
        and np.isfinite(guess.duals.sum())
    ):
        return None
    if turns:
        guess.states[1:, 2] -= turns
    return guess
