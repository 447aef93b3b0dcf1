"""The periods behind: what was sent, from where, and what the model expected of it."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array


class CommandHistory:
    """Commands sent, and the last period as those who learn from it want to see it.

    Parameters
    ----------
    problem : NavigationProblem
        Period and command bounds.
    history : int
        Past commands that the model depends on, L.
    pose_age : float
        How old poses are on arrival [s].
    """

    def __init__(self, problem: NavigationProblem, history: int, pose_age: float) -> None:
        self._u_min, self._u_max, _, _ = problem.bounds
        self._history = history
        self._periods = int(np.ceil(pose_age / problem.dt)) + history if pose_age else 0
        self.reset()

    def reset(self) -> None:
        """Forget everything; the robot is taken to have stood."""
        self.command: Array = np.zeros(INPUTS)
        """(2,) the one sent last."""
        self.commands = np.zeros((self._history, INPUTS))
        """(L, 2) that the model wants to know, oldest first."""
        self.given = np.zeros((self._periods, INPUTS))
        """Those since the newest pose was taken, and the L before, oldest first."""
        self.seen: Array = np.zeros(STATES)
        """(3,) pose that was measured last."""
        self.driven: tuple[Array, Array, Array] | None = None
        """Pose, command and the L before it, of the past period; none where nobody knows what was
        sent."""
        self.planned: tuple[Array, Array, Array, Array] | None = None
        """The same of a planned period with, before the last, the pose expected at its end;
        headings within one turn."""

    def expect(self, here: Array, command: Array, expected: Array) -> None:
        """Keep what a plan says of the coming period; before `remember`."""
        self.planned = here, command.copy(), expected, self.commands.copy()

    def remember(self, command: Array) -> None:
        """Take in the command that is sent now."""
        self.command = command.copy()
        self.driven = self.seen, self.command, self.commands.copy()
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[:-1] = earlier[1:]
                earlier[-1] = command

    def correct(self, command: Array, model: KoopmanModel) -> None:
        """Put what was really sent, NaN where nobody knows, in the place of the last command.

        Raises
        ------
        ValueError
            For a wrong shape.
        """
        if command.shape != (INPUTS,):
            raise ValueError(f"sent: expected shape ({INPUTS},), got {command.shape}")
        if not np.isfinite(command).all():
            self.driven = self.planned = None
            return
        self.command = np.clip(command, self._u_min, self._u_max)
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[-1] = command
        if self.driven is not None:
            before, _, earlier = self.driven
            self.driven = before, command.copy(), earlier
        if self.planned is not None:
            here, _, _, earlier = self.planned
            self.planned = here, command.copy(), model.predict(here, command, earlier), earlier
