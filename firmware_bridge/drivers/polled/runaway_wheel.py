"""Tells of a wheel that runs away: faster than anybody asks for, or the other way round.

Exchanged lines of an encoder do that: the board's speed loop then pushes where it should brake.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from firmware_bridge.drivers.polled.dead_wheel import SIDES

PATIENCE = 1.0
"""Commands within this time may still act [s]: longer than any motor's lag."""
OVERSHOOT, MARGIN = 1.5, 0.25
"""Largest wheel speed relative to the command, plus this share of its top speed."""
LASTS = 0.2
"""It runs away once it does so for this long [s]."""
HINT = "are the lines of its encoder or its motor exchanged?"


@dataclass
class Wheel:
    """Recent commands of a wheel."""

    told: deque[tuple[float, float]] = field(default_factory=deque)
    """When [s], and what [rad/s]."""
    wrong_since: float = math.inf
    """[s]"""

    def excess(self, speed: float, now: float, margin: float) -> str:
        """What is wrong with a speed [rad/s], in words; empty where nothing is."""
        while self.told[0][0] < now - PATIENCE:
            self.told.popleft()
        slowest, fastest = (
            min(told for _, told in self.told),
            max(told for _, told in self.told),
        )
        largest = max(fastest, -slowest)
        if largest == 0.0:  # not driven: it is pushed, or rolls
            return ""
        if abs(speed) > OVERSHOOT * largest + margin:
            return "runs faster than commanded"
        whole = now - self.told[0][0] >= 0.9 * PATIENCE
        if whole and slowest * fastest > 0.0 and speed * fastest < 0.0 and abs(speed) > margin:
            return "turns against its command"
        return ""


class RunawayWheels:
    """Compares the speeds of both wheels with their commands; a fault stays until `forget`.

    Parameters
    ----------
    top : float
        Largest speed of a wheel [rad/s].

    Examples
    --------
    >>> wheels = RunawayWheels(top=20.0)
    >>> for k in range(12):
    ...     wheels.take((6.0, 6.0), (6.1, 19.0), 0.02 * k)
    >>> wheels.faults()[0][:43]
    'the right wheel runs faster than commanded'
    """

    def __init__(self, top: float) -> None:
        self._margin = MARGIN * top
        self._wheels = (Wheel(), Wheel())
        self._faults: tuple[str, ...] = ()

    def forget(self) -> None:
        """Begin anew: the motors were let go."""
        self._wheels, self._faults = (Wheel(), Wheel()), ()

    def faults(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        return self._faults

    def take(self, told: tuple[float, float], speeds: tuple[float, float], now: float) -> None:
        """Take the commands and the speeds of both wheels [rad/s], left and right."""
        for side, wheel, wanted, speed in zip(SIDES, self._wheels, told, speeds, strict=True):
            wheel.told.append((now, wanted))
            words = wheel.excess(speed, now, self._margin)
            if not words:
                wheel.wrong_since = math.inf
                continue
            wheel.wrong_since = min(wheel.wrong_since, now)
            if now - wheel.wrong_since >= LASTS - 1e-6 and not self._faults:
                self._faults = (f"the {side} wheel {words}: {HINT}",)
