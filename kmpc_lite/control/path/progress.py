"""Time lost on the way: since the best time to go last fell, of the path and of the goal.

Of the path it is the patience of a robot that stands: then it looks for a path from where it is. Of
the goal it tells that the robot has stalled: whatever paths it was given meanwhile, it has not come
nearer than before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

PROGRESS_TIME = 0.05
"""How much time of its path the robot must have left behind for that to count as progress [s]."""
PATIENCE = 0.8
"""How long the robot may stand before it looks for a path from where it is [s]."""
DETOUR_TIME = 0.5
"""A new path that is longer than what was left of the old one by this time is a detour: the
patience begins anew [s]."""


@dataclass(slots=True)
class ProgressState:
    """What is remembered from path to path."""

    least_left: float = math.inf
    """Least time to the goal on this path so far [s]."""
    waited: float = 0.0
    """Time lost on this path [s]; negative while the first turn is made."""
    best_left: float = math.inf
    """Least time to this goal that any path has told so far [s]."""
    worst_left: float = 0.0
    """Largest one told since [s]."""
    lost: float = 0.0
    """Time lost since the best [s], or since something else was tried."""
    stalls: int = 0
    """How often, one after the other, something else had to be tried."""

    @property
    def is_stuck(self) -> bool:
        """Whether the robot has stood for too long."""
        return self.waited > PATIENCE

    def expect_new_path(self) -> None:
        """Let the next path begin a new count: the map or the goal is another one."""
        self.least_left = -math.inf

    def begin_path(self, left: float, turn: float, other: bool) -> None:
        """Begin a path.

        `left`: time that the path takes [s]. `turn`: time of its first turn, which the controller
        makes while driving [s]: that turn is no progress along the path, but the robot does not
        stand either. `other`: whether it leads another way around than the one before. A path like
        the one before begins a new count only if it is longer by a detour: a robot that swings
        before an obstacle, and looks for its path again and again, makes no progress.
        """
        if other or left > self.least_left + DETOUR_TIME:
            self.least_left, self.waited = left, -turn
        # a path that is quicker from the same place is no progress
        self.best_left = min(self.best_left, left)

    def see(self, left: float, period: float) -> bool:
        """Let a period pass [s] with so much left of the path [s]; whether it has stood too long.

        The robot is not on its last turn.
        """
        if left < self.least_left - PROGRESS_TIME:
            self.least_left, self.waited = left, 0.0
        self.waited += period
        return self.is_stuck

    def watch(self, left: float, period: float, longest: float) -> bool:
        """Let a period pass, and tell whether the robot has stalled: something else is to be tried.

        `left`: time to the goal [s of path]. `period`: time that has passed [s]; zero while the
        robot lets something pass. `longest`: time that may be lost [s].

        Notes
        -----
        A robot that gets on may drive a detour to its end: where its path is longer than the best
        one was, it has twice the difference more time.
        """
        if left < self.best_left - PROGRESS_TIME:
            self.best_left = self.worst_left = left
            self.lost, self.stalls = 0.0, 0
        self.worst_left = max(self.worst_left, left)
        self.lost += period
        detour = 2.0 * (self.worst_left - self.best_left)
        if self.lost <= longest + (0.0 if self.waited > longest else detour):
            return False
        self.lost, self.worst_left = 0.0, self.best_left
        self.stalls += 1
        return True

    def gets_on(self, left: float) -> bool:
        """Whether a robot that has stalled gets on since: on a detour it is not nearer for long."""
        return not self.is_stuck and self.worst_left - left > PATIENCE
