"""What the robot does when no new plan can be had: the tail of the last good one, then a braking ramp, then it stands."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.nmpc.sqp import Trajectory
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.safe_stop.stop_trajectory import StopTrajectory, ramp
from kmpc_lite.types import Array


class Backup:
    """Remembers the tail of the last good plan and the last command sent.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, period and deceleration.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._ramp_step = np.asarray(problem.deceleration) * problem.dt
        self.reset()

    def reset(self) -> None:
        """Forget everything; the robot is taken to stand."""
        self._inputs: Array | None = None
        self._tail = StopTrajectory()
        self._rest: Array | None = None
        self._command: Array = np.zeros(2)
        self.expected: Array | None = None
        """Pose (3,) at which the period begins that `replay` gives commands for, as far as the
        model knows."""

    def accept(self, plan: Trajectory, tail: StopTrajectory) -> None:
        """Remember a good plan whose first command is sent now, and what follows if there is no other."""
        # copies, for the plan goes to the caller
        self._inputs, self._tail, self._rest = plan.inputs[: 1 + tail.further].copy(), tail, None
        self._command, self.expected = self._inputs[0], plan.states[1].copy()

    def replay(self) -> Array | None:
        """Return the rest of the last tail (T, 2), one period less each time, or None once it has ended in a stop."""
        if self._inputs is not None:
            # worked out only now, for it is rarely needed
            self._rest, self._inputs = self._tail.commands(self._inputs, self._ramp_step), None
        self._rest = None if self._rest is None or len(self._rest) < 2 else self._rest[1:]
        return self._rest

    def sent(self, command: Array, expected: Array | None) -> None:
        """Remember the command (2,) of the tail that is sent, and the pose (3,) to which it leads."""
        self._command, self.expected = command.copy(), expected

    def brake(self, at_once: bool = False) -> Array:
        """Return the next command (2,) of the braking ramp, which ends at zero, or zero; the old plan is dropped."""
        self._inputs = self._rest = self.expected = None
        self._command = np.zeros(2) if at_once else ramp(self._command, self._ramp_step)[0]
        return self._command
