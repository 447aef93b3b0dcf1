"""The periods behind: what was sent, from where, and what the model expected of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array

CREEPS = 1e-3
"""Speed below which a command says nothing of how the wheels are steered [m/s]."""


@dataclass(frozen=True, eq=False, slots=True)
class DrivenPeriod:
    """One period as adaptation and the drift detector want to see it."""

    pose: Array
    """(3,) at its beginning."""
    command: Array
    """(2,) that was held during it."""
    earlier: Array
    """(L, 2) commands before it, oldest first."""
    expected: Array | None = None
    """(3,) pose that a plan expected at its end."""


@dataclass(slots=True)
class CommandHistory:
    """Commands sent, and the last period: data, in the robot's units."""

    command: Array
    """(2,) the one sent last."""
    commands: Array
    """(L, 2) that the model wants to know, oldest first."""
    given: Array
    """(K, 2) those since the newest pose was taken, and the L before, oldest first."""
    measured: Array
    """(3,) pose that was measured last."""
    curvature: float = 0.0
    """Of the last command that drove the robot [1/m]."""
    driven: DrivenPeriod | None = None
    """The past period, from the measured pose; none where nobody knows what was sent."""
    planned: DrivenPeriod | None = None
    """The past period, from the pose within one turn, where a plan was driven."""

    @classmethod
    def start(cls, problem: NavigationProblem, history: int, pose_age: float) -> CommandHistory:
        """History of a robot that stands.

        Parameters
        ----------
        problem : NavigationProblem
            Its period.
        history : int
            Past commands that the model depends on, L.
        pose_age : float
            How old poses are on arrival.
        """
        inputs = len(problem.u_min)
        periods = int(np.ceil(pose_age / problem.dt)) + history if pose_age else 0
        return cls(
            np.zeros(inputs),
            np.zeros((history, inputs)),
            np.zeros((periods, inputs)),
            np.zeros(STATES),
        )

    def expect(self, pose: Array, command: Array, expected: Array) -> None:
        """Keep what a plan says of the coming period; before `remember`."""
        self.planned = DrivenPeriod(pose, command.copy(), self.commands.copy(), expected)

    def remember(self, command: Array) -> None:
        """Take in the command that is sent now."""
        self.command = command.copy()
        self._see_curvature()
        self.driven = DrivenPeriod(self.measured, self.command, self.commands.copy())
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[:-1] = earlier[1:]
                earlier[-1] = command

    def _see_curvature(self) -> None:
        speed, turn_rate = float(self.command[0]), float(self.command[-1])
        if abs(speed) > CREEPS:
            self.curvature = turn_rate / speed

    def correct(self, command: Array, model: MotionModel, problem: NavigationProblem) -> None:
        """Put what was really sent, NaN where nobody knows, in the place of the last command."""
        if not np.isfinite(command).all():
            self.driven = self.planned = None
            return
        self.command = problem.within_bounds(command)
        self._see_curvature()
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[-1] = command
        if self.driven is not None:
            self.driven = DrivenPeriod(self.driven.pose, command.copy(), self.driven.earlier)
        if self.planned is not None:
            before = self.planned
            expected = model.predict(before.pose, command, before.earlier)
            self.planned = DrivenPeriod(before.pose, command.copy(), before.earlier, expected)
