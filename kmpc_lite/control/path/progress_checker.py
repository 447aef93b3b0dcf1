"""Whether the robot gets nearer to its goal, stands before something, or has stalled.

Two times are counted. The short one is the patience of a robot that stands: then it looks for a
path from where it is. The long one tells that it has stalled: it has not come nearer to its goal
than before, or has not moved at all, whatever paths it was given meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.control.options.guidance import GuidanceOptions
from kmpc_lite.types import Array

PROGRESS_TIME = 0.05
"""How much time of its path the robot must have left behind for that to count as progress [s]."""
PATIENCE = 0.8
"""How long the robot may stand before it looks for a path from where it is [s]."""
DETOUR_TIME = 0.5
"""A new path that is longer than what was left of the old one by this time is a detour: the
patience begins anew [s]."""
STALL_DISTANCE = 0.15
"""A robot that moves farther than this within that time has not stalled yet on a detour [m]."""

NOWHERE = (math.inf, math.inf, math.inf)


@dataclass(slots=True)
class ProgressState:
    """What the progress checker remembers, from path to path."""

    least_left: float = math.inf
    """Least time to the goal so far [s of path]."""
    waited: float = 0.0
    """Time since it last shrank [s]; negative while the first turn is made."""
    stuck: bool = False
    """Whether the robot has stood for too long."""
    best_left: float = math.inf
    """Least time to this goal that any path has told so far [s]."""
    worst_left: float = 0.0
    """Largest one told since [s]."""
    since_best: float = 0.0
    """Time since the best [s]."""
    anchor: tuple[float, float, float] = NOWHERE
    """Pose whose place the robot has not moved away from [m, m, rad]."""
    since_moved: float = 0.0
    """Time since it was there first [s]."""
    stalls: int = 0
    """How often, one after the other, something else had to be tried."""


class ProgressChecker:
    """Counts the time without progress.

    Parameters
    ----------
    options : GuidanceOptions
        What counts as progress, and the patience.
    """

    def __init__(self, options: GuidanceOptions) -> None:
        self._progress, self._patience = PROGRESS_TIME, PATIENCE
        self._detour = DETOUR_TIME
        self._stall = options.stall_time
        self._distance = STALL_DISTANCE

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
            begins a new count only if it is longer by a detour: a robot that swings before an
            obstacle, and looks for its path again and again, makes no progress.
        """
        if other or left > state.least_left + self._detour:
            state.least_left, state.waited = left, -turn
        # a path that is quicker from the same place is no progress
        state.best_left = min(state.best_left, left)

    def expect_new_goal(self, state: ProgressState) -> None:
        """Begin anew: what was reached of another goal does not count."""
        state.best_left, state.worst_left = math.inf, 0.0
        state.since_best, state.stalls = 0.0, 0
        state.anchor = NOWHERE

    def watch(self, state: ProgressState, pose: Array, left: float, period: float) -> bool:
        """Let a period pass, and tell whether the robot has stalled: something else is to be tried.

        Parameters
        ----------
        state : ProgressState
            Updated.
        pose : ndarray
            Of the robot (3,).
        left : float
            Time to the goal [s of path].
        period : float
            Time that has passed [s]; zero while the robot lets something pass.

        Notes
        -----
        A robot that moves may drive a detour to its end: where its path is longer than the best one
        was, it has twice the difference more time.
        """
        if left < state.best_left - self._progress:
            state.best_left = state.worst_left = left
            state.since_best, state.stalls = 0.0, 0
        state.worst_left = max(state.worst_left, left)
        x, y, heading = pose.tolist()
        x_then, y_then, _ = state.anchor
        moved = math.hypot(x - x_then, y - y_then) > self._distance
        if moved:
            state.anchor, state.since_moved = (x, y, heading), 0.0
        state.since_best += period
        state.since_moved += period
        detour = 2.0 * (state.worst_left - state.best_left)
        stands = state.since_moved > self._stall
        if state.since_best <= self._stall + (0.0 if stands else detour):
            return False
        state.since_best = state.since_moved = 0.0
        state.worst_left = state.best_left
        state.stalls += 1
        return True


def gets_on(state: ProgressState, left: float, patience: float) -> bool:
    """Whether a robot that has stalled gets on since: along a detour it is not nearer for long.

    Parameters
    ----------
    state : ProgressState
        As `ProgressChecker.watch` left it.
    left : float
        Time to the goal [s of path].
    patience : float
        How much of its path it must have left behind [s].
    """
    moved = state.since_moved < state.since_best
    return moved and state.worst_left - left > patience
