"""Tells of a wheel that is driven and whose counter stands: its encoder is dead, or its motor."""

from __future__ import annotations

import math
from dataclasses import dataclass

SIDES = "left", "right"
PATIENCE = 1.0
"""How long a driven wheel's counter may stand [s]: longer than any motor's lag."""
TRAVEL, COUNTS = 0.15, 3.0
"""Smallest commanded distance before that [m], or counts: a slow wheel may stick,
and a coarse encoder says little."""
SHARE = 0.02
"""Share of the commanded turn below which a counter stands."""


@dataclass
class Stretch:
    """Commanded and measured turn of a wheel since its counter moved last."""

    since: float = math.nan
    """[s]"""
    told: float = 0.0
    """[rad]"""
    turned: float = 0.0
    """[rad]"""


class DeadWheels:
    """Compares the commands of both wheels with their counters.

    Parameters
    ----------
    wheel_radius : float
        [m]
    count : float
        How far a wheel turns in a count of its encoder [rad].

    Examples
    --------
    >>> wheels = DeadWheels(wheel_radius=0.05, count=0.01)
    >>> for k in range(120):
    ...     wheels.take((6.0, 6.0), (0.06, 0.0), 0.01 * k)
    >>> wheels.faults()[0][:48]
    'the right wheel is driven and its counter stands'
    """

    def __init__(self, wheel_radius: float, count: float) -> None:
        self._farthest = max(TRAVEL / wheel_radius, COUNTS * count)
        self._stretches = (Stretch(), Stretch())
        self._last: float | None = None

    def forget(self) -> None:
        """Begin anew: the motors were let go, or the board was set up."""
        self._stretches, self._last = (Stretch(), Stretch()), None

    def take(self, told: tuple[float, float], turned: tuple[float, float], now: float) -> None:
        """Take the commanded speeds of both wheels [rad/s], and how far they turned [rad].

        Left and right, since the last call; `now` is when the counters were read [s].
        """
        dt = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        for stretch, speed, step in zip(self._stretches, told, turned, strict=True):
            stretch.told += speed * dt
            stretch.turned += step
            if not abs(stretch.turned) <= SHARE * abs(stretch.told) or math.isnan(stretch.since):
                stretch.since, stretch.told, stretch.turned = now, 0.0, 0.0

    def faults(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        return tuple(
            f"the {side} wheel is driven and its counter stands: is its encoder unplugged, or its "
            "motor off or blocked?"
            for side, stretch in zip(SIDES, self._stretches, strict=True)
            if self._last is not None
            and abs(stretch.told) >= self._farthest
            and self._last - stretch.since >= PATIENCE
        )
