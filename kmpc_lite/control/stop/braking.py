"""How a robot brakes: the ramp that ends a command, and where the robot stands after it."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

ROUNDING = 1e-9
"""Rounding error of a count of periods."""
LONGEST_RAMP = 10.0
"""Longest braking ramp [s]; a robot that brakes more slowly is told to stand by then."""
UNLIMITED = 1e6
"""Largest change of a command in a period that is reckoned with: more than any speed [m/s]."""


class Braking:
    """Braking ramps of one problem.

    Parameters
    ----------
    problem : NavigationProblem
        Period, `deceleration` and `du_max`.

    Attributes
    ----------
    ramp_step : ndarray
        (2,) by which a braked command may shrink in a period [m/s, rad/s].
    longest_ramp : int
        Most periods of a ramp.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._dt = problem.dt
        self.ramp_step: Array = np.asarray(problem.deceleration) * problem.dt
        self.longest_ramp = max(round(LONGEST_RAMP / problem.dt), 1)
        self._rate_step = np.minimum(problem.dt * problem.du_max, UNLIMITED)

    def ramp(self, command: Array) -> Array:
        """Commands (T, 2) that brake a robot after a command (2,); the last is zero.

        Both speeds shrink by one factor, so that the robot keeps to the curve that it is on.
        """
        periods = float((np.abs(command) / self.ramp_step).max())
        count = max(1, min(math.ceil(periods - ROUNDING), self.longest_ramp))
        shares = 1.0 - np.arange(1, count + 1) / max(periods, ROUNDING)
        shares[-1] = 0.0
        commands: Array = shares[:, None] * command
        return commands

    def pose_at_rest(self, pose: Array, last: Array) -> Array:
        """Pose (3,) at which a robot stands that brakes at `du_max` from the last command (2,)."""
        periods = np.floor(np.abs(last) / self._rate_step)
        shrinking = 0.5 * np.copysign(self._rate_step, last) * (periods + 1.0)
        ahead, *aside, turn = (self._dt * periods * (last - shrinking)).tolist()
        heading = float(pose[2]) + 0.5 * turn
        cos, sin = math.cos(heading), math.sin(heading)
        x, y = pose[0] + ahead * cos, pose[1] + ahead * sin
        for left in aside:
            x, y = x - left * sin, y + left * cos
        return np.array([x, y, pose[2] + turn])
