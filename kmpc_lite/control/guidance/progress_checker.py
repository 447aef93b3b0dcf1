"""Whether the robot gets nearer to its goal, or stands before something."""

from __future__ import annotations

import math

STILL = 0.05
"""Progress towards the goal that ends a stand [s]."""
PATIENCE = 0.8
"""How long the robot may stand [s]."""
DETOUR = 0.5
"""How much longer a new way must be than what was left to begin a new count [s]: a robot that
shuttles before an obstacle, and looks for its way again and again, makes no progress."""


class ProgressChecker:
    """Counts the time without progress, from way to way."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._least, self._time = math.inf, 0.0
        self.stuck = False
        """Whether the robot has stood for too long."""

    def forget(self) -> None:
        """Let the next way begin a new count: the map or the goal is another one."""
        self._least = -math.inf

    def see(self, left: float) -> None:
        """Look at the time that is left to the goal [s]."""
        if left < self._least - STILL:
            self._least, self._time = left, 0.0

    def wait(self, period: float) -> bool:
        """Let a period pass [s], and tell whether the robot has stood for too long."""
        self._time += period
        self.stuck = self._time > PATIENCE
        return self.stuck

    def begin(self, left: float, turn: float, other: bool) -> None:
        """Begin a way of some length [s], with a turn [s] that the controller makes while driving; `other` than the one before."""
        if other or left > self._least + DETOUR:
            # that turn is no progress along the way, but no stand either
            self._least, self._time = left, -turn
