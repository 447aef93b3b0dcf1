"""What happens when no new plan can be had, because OSQP failed or no stop is clear.

The stop trajectory of the last good plan is driven, then a braking ramp, then the robot stands.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.control.stop.stop_task import StopTrajectory
from kmpc_lite.types import Array


@dataclass(slots=True)
class BackupState:
    """The last good plan as far as its stop trajectory needs it, and the last command sent."""

    inputs: Array | None = None
    """(K, 2) commands of the last good plan that its stop trajectory drives; none where the rest of
    the stop trajectory is worked out already, or where there is none."""
    stop: StopTrajectory = StopTrajectory()
    """Of the last good plan."""
    rest: Array | None = None
    """(T, 2) what is left of the stop trajectory."""
    command: Array = field(default_factory=lambda: np.zeros(2))
    """(2,) sent last."""
    expected: Array | None = None
    """Pose (3,) at which the period begins that `replay` gives commands for, as far as the model
    knows."""


class Backup:
    """Drives the stop trajectory of the last good plan, then brakes.

    Parameters
    ----------
    problem : NavigationProblem
        Period and deceleration.
    options : StopOptions, optional
        Longest ramp.
    """

    def __init__(self, problem: NavigationProblem, options: StopOptions | None = None) -> None:
        self._braking = Braking(problem, StopOptions() if options is None else options)

    def accept(
        self, state: BackupState, states: Array, inputs: Array, stop: StopTrajectory
    ) -> None:
        """Remember a good plan whose first command is sent now, and what follows without another.

        Parameters
        ----------
        state : BackupState
            Updated.
        states, inputs : ndarray
            The plan (N + 1, 3) and (N, 2).
        stop : StopTrajectory
            Its stop trajectory.
        """
        # copies, for the plan goes to the caller
        state.inputs, state.stop, state.rest = inputs[: 1 + stop.further].copy(), stop, None
        state.command, state.expected = state.inputs[0], states[1].copy()

    def replay(self, state: BackupState) -> Array | None:
        """Return the rest of the last stop trajectory (T, 2), one period less each time.

        None once it has ended, and where there is none.
        """
        if state.inputs is not None:
            # worked out only now, for it is rarely needed
            state.rest = state.stop.commands(state.inputs, self._braking)
            state.inputs = None
        state.rest = None if state.rest is None or len(state.rest) < 2 else state.rest[1:]
        return state.rest

    def sent(self, state: BackupState, command: Array, expected: Array | None) -> None:
        """Remember the command (2,) that is sent instead, and the pose (3,) to which it leads."""
        state.command, state.expected = command.copy(), expected

    def brake(self, state: BackupState, at_once: bool = False) -> Array:
        """Return the next command (2,) of the braking ramp, at last zero; the old plan is dropped.

        Parameters
        ----------
        state : BackupState
            Updated.
        at_once : bool
            Whether the command is zero at once, for a ramp that would end in an obstacle.
        """
        state.inputs = state.rest = state.expected = None
        state.command = np.zeros(2) if at_once else self._braking.ramp(state.command)[0]
        return state.command
