"""Whether the robot gets nearer to its goal, or stands before something."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.control.options.guidance import GuidanceOptions


@dataclass(slots=True)
class ProgressState:
    """What the progress checker remembers, from path to path."""

    least_left: float = math.inf
    """Least time to the goal so far [s of path]."""
    waited: float = 0.0
    """Time since it last shrank [s]; negative while the first turn is made."""
    stuck: bool = False
    """Whether the robot has stood for too long."""


class ProgressChecker:
    """Counts the time without progress.

    Parameters
    ----------
    options : GuidanceOptions
        What counts as progress, and the patience.
    """

    def __init__(self, options: GuidanceOptions) -> None:
        self._progress, self._patience = options.progress_time, options.patience
        self._detour = options.detour_time

    def expect_new_path(self, state: ProgressState) -> None:
        """Let the next path begin a new count: the map or the goal is another one."""
        state.least_left = -math.inf

    def see(self, state: ProgressState, left: float) -> None:
        """Look at the time that is left to the goal [s]."""
        if left < state.least_left - self._progress:
            state.least_left, state.waited = left, 0.0

    def wait(self, state: ProgressState, period: float) -> bool:
        """Let a period pass [s], and tell whether the robot has stood for too long."""
        state.waited += period
        state.stuck = state.waited > self._patience
        return state.stuck

    def begin_path(self, state: ProgressState, left: float, turn: float, other: bool) -> None:
        """Begin a path.

        Parameters
        ----------
        state : ProgressState
            Updated.
        left : float
            Time that the path takes [s].
        turn : float
            Time of its first turn, which the controller makes while driving [s]: that turn is no
            progress along the path, but the robot does not stand either.
        other : bool
            Whether it leads another way around than the one before. A path like the one before
            begins a new count only if it is longer by a detour: a robot that shuttles before an
            obstacle, and looks for its path again and again, makes no progress.
        """
        if other or left > state.least_left + self._detour:
            state.least_left, state.waited = left, -turn
