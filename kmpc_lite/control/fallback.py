"""What the robot does when no new plan can be had: the rest of the last good one, then a braking ramp."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.sqp import Trajectory
from kmpc_lite.dictionary import Array

REPLAY_TIME = 0.5
"""For how long the rest of a plan is driven without a new one [s]: what is around may have moved."""


class Fallback:
    """Remembers the last good plan and the last command sent.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, period and deceleration.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._ramp = np.asarray(problem.deceleration) * problem.dt
        self._u_min, self._u_max, _, _ = problem.bounds
        self._replay_steps = int(round(REPLAY_TIME / problem.dt))
        self.reset()

    def reset(self) -> None:
        """Forget everything; the robot is taken to stand."""
        self._plan: Trajectory | None = None
        self._age = 0
        self._command: Array = np.zeros(2)

    def accept(self, plan: Trajectory) -> None:
        """Remember a good plan whose first command is sent now."""
        self._plan, self._age, self._command = plan, 0, plan.inputs[0].copy()

    def replay(self) -> Trajectory | None:
        """Return the rest of the last good plan, one period older each time, or None once it is too old."""
        if self._plan is None or self._age >= min(self._replay_steps, len(self._plan.inputs) - 1):
            return None
        self._age += 1
        states, inputs = self._plan.states[self._age :], self._plan.inputs[self._age :]
        # the last thing between a plan that somebody has overwritten and the motors; also true for NaN
        if not (np.isfinite(states).all() and (inputs >= self._u_min).all() and (inputs <= self._u_max).all()):
            return None
        self.sent(inputs[0])
        return Trajectory(states, inputs, self._plan.duals)

    def sent(self, command: Array) -> None:
        """Remember the command (2,) that is sent in place of the plan's."""
        self._command = command.copy()

    def brake(self) -> Array:
        """Return the next command (2,) of the braking ramp, which ends at zero; the old plan is dropped."""
        self._plan = None
        # both speeds shrink by one factor, so that the robot keeps to the curve that it is on
        speed = np.abs(self._command)
        factor = float(np.max(np.maximum(speed - self._ramp, 0.0) / np.where(speed > 0.0, speed, 1.0)))
        self._command = factor * self._command if factor > 1e-3 else np.zeros(2)
        return self._command
