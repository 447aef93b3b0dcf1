"""How far a command may be from the one before it, and how a robot brakes."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

ROUNDING = 1.0 + 1e-9
"""A change that is larger than allowed by less than this factor is the largest one allowed."""
LONGEST_RAMP = 10.0
"""Longest braking ramp [s]; a robot that brakes more slowly is told to stand by then."""
LITTLE = 1e-9
"""Rounding error of a count of periods."""


class RateLimit:
    """Limits on the change of commands from one period to the next, and braking ramps.

    `problem`: `du_max`, `deceleration`, and the period.

    Attributes: `active`: whether anything is limited. `faster`, `slower`: by how much commands may
    change in a period, away from zero and towards it. `ramp_step`: by how much a braked command may
    shrink in a period [m/s, rad/s]. `longest_ramp`: most periods of a ramp.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self.active = problem.limits_changes
        self._within = problem.wheels.within
        self.faster = problem.dt * problem.du_max
        self.slower = problem.dt * np.maximum(problem.du_max, problem.deceleration)
        self.ramp_step: Array = np.asarray(problem.deceleration) * problem.dt
        self.longest_ramp = max(round(LONGEST_RAMP / problem.dt), 1)
        if self.active:
            steps = np.arange(1, problem.horizon + 1)[:, None]
            self._reach = steps * self.faster

    def limit(self, command: Array, last: Array) -> Array:
        """Go from the last command (2,) towards a new one (2,) as far as is allowed.

        Speed and turn rate change by one share. A speed that shrinks may do so at the problem's
        deceleration where that is more.
        """
        if not self.active:
            return command
        change = command - last
        allowed = np.where(
            change * last < 0.0,
            np.maximum(self.faster, np.minimum(self.slower, np.abs(last))),
            self.faster,
        )
        size = np.abs(change)
        over = size > allowed * ROUNDING
        if not over.any():
            return command
        limited = last + float((allowed[over] / size[over]).min()) * change
        return self._within(limited)

    def first(self, last: Array) -> tuple[Array, Array]:
        """Least and largest first command of a plan, (2,) each."""
        return last - self.faster, last + self.faster

    def in_reach(self, inputs: Array, last: Array) -> Array:
        """Bring the commands of a guess (N, 2) as near to the last command (2,) as they must be.

        Zeros become a braking ramp.
        """
        return np.clip(inputs, last - self._reach, last + self._reach)

    def ramp(self, command: Array) -> Array:
        """Commands (T, 2) that brake a robot after a command (2,); the last is zero.

        Both speeds shrink by one factor, so that the robot keeps to the curve that it is on.
        """
        periods = float((np.abs(command) / self.ramp_step).max())
        count = max(1, min(math.ceil(periods - LITTLE), self.longest_ramp))
        shares = 1.0 - np.arange(1, count + 1) / max(periods, LITTLE)
        shares[-1] = 0.0
        commands: Array = shares[:, None] * command
        return commands
