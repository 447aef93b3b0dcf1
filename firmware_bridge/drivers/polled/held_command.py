"""The newest command to a board: until it is sent, and for how long it may stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

STANDSTILL = (0.0, 0.0)


@dataclass
class HeldCommand:
    """Speeds of both channels; the driver's lock is held around every call."""

    timeout: float
    """A command that is older is replaced by zero [s]."""
    repeats: int
    """How often a zero is repeated."""
    value: tuple[float, float] = STANDSTILL
    """[motor turns/s]"""
    stamp: float = -math.inf
    """When it came, on the monotonic clock [s]."""
    pending: bool = False
    """Whether it is still to be sent."""
    zeros: int = 0
    """How many repetitions of a zero are left."""

    def put(self, value: tuple[float, float], now: float) -> None:
        """Take a new command [motor turns/s]."""
        self.value, self.stamp = value, now
        self.pending, self.zeros = True, self.repeats

    def repeat_zero(self) -> None:
        """Send a zero once more, where it may have been lost."""
        if self.zeros and self.value == STANDSTILL:
            self.zeros -= 1
            self.pending = True

    def withdraw_old(self, now: float) -> bool:
        """Replace a command that has become old by zero; True where that was needed."""
        if self.value == STANDSTILL or now - self.stamp <= self.timeout:
            return False
        self.value, self.pending, self.zeros = STANDSTILL, True, self.repeats
        return True

    def stands(self, now: float) -> bool:
        """Whether a standstill is requested now, or nothing yet."""
        never = self.stamp == -math.inf
        return self.value == STANDSTILL and (never or now - self.stamp < self.timeout)
