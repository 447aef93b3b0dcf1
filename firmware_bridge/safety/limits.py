"""Limits on commands and on their change; one factor scales all speeds, to keep the curve."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.messages import Speeds
from firmware_bridge.options import bounded, check

STANDS = 1e-3
"""Speed that no wheel drives [m/s, rad/s]."""
ZERO = 1e-9
"""Speeds below this [m/s, rad/s] are zero."""


@dataclass(frozen=True)
class Limits:
    """What a command may be; the defaults are slow on purpose.

    Raises ConfigError: names the limit that is out of range.
    """

    v_max: float = bounded(1e-4, 100.0, "m/s", 0.3)
    """Forward [m/s]."""
    v_reverse: float = bounded(0.0, 100.0, "m/s", 0.3)
    """Backwards [m/s]; 0 for a robot that must not."""
    omega_max: float = bounded(1e-4, 100.0, "rad/s", 0.8)
    """Either way [rad/s]."""
    acceleration: float = bounded(1e-3, 1e3, "m/s^2", 1.0)
    """Away from zero [m/s^2]."""
    deceleration: float = bounded(1e-3, 1e3, "m/s^2", 1.0)
    """Towards zero [m/s^2]."""
    angular_acceleration: float = bounded(1e-3, 1e4, "rad/s^2", 4.0)
    """Away from zero [rad/s^2]."""
    angular_deceleration: float = bounded(1e-3, 1e4, "rad/s^2", 4.0)
    """Towards zero [rad/s^2]."""
    v_sideways: float | None = bounded(1e-4, 100.0, "m/s", None)
    """Of an omni, either way [m/s]; `v_max` if not given."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)

    @property
    def sideways(self) -> float:
        """Largest speed of an omni to either side [m/s]."""
        return self.v_max if self.v_sideways is None else self.v_sideways

    def clip(self, speeds: Speeds, share: float = 1.0) -> Speeds:
        """Scale finite speeds by one factor until all are within bounds.

        With a `share` below 1 the bounds are that much narrower; slower commands are unchanged.
        """
        highest = self.v_max, self.omega_max, self.sideways
        lowest = -self.v_reverse, -self.omega_max, -self.sideways
        bounds = [(share * low, share * high) for low, high in zip(lowest, highest, strict=True)]
        scale = 1.0
        for value, (low, high) in zip(speeds, bounds, strict=True):
            if abs(value) < STANDS:
                continue  # a way that is not driven limits no other by what rounding leaves of it
            if value > high:
                scale = min(scale, high / value)
            elif value < low:
                scale = min(scale, low / value)
        v, omega, vy = (
            min(max(value * scale, low), high)  # clips what rounding left outside
            for value, (low, high) in zip(speeds, bounds, strict=True)
        )
        return v, omega, vy

    def slew(
        self, start: Speeds, target: Speeds, dt: float, longest_rise: float = math.inf
    ) -> Speeds:
        """Move from one command towards another for `dt` [s], on a straight line between them.

        Away from zero it goes for `longest_rise` [s] at most.
        """
        if dt <= 0.0:
            return start
        rise = min(dt, longest_rise)
        drive = self.acceleration * rise, self.deceleration * dt
        turn = self.angular_acceleration * rise, self.angular_deceleration * dt
        share = min(map(_share, start, target, (drive, turn, drive)))
        if share >= 1.0:
            return target
        # zero on the way to zero only: a slow ramp away from it begins with less
        v, omega, vy = (
            0.0 if max(abs(value), abs(b)) < ZERO else value
            for value, b in ((a + share * (b - a), b) for a, b in zip(start, target, strict=True))
        )
        return v, omega, vy


def _share(start: float, target: float, limits: tuple[float, float]) -> float:
    """Share of the change from `start` to `target` within limits away from zero, and towards it."""
    up, down = limits
    change = abs(target - start)
    if change == 0.0:
        return 1.0
    if start * target < 0.0:
        shrinking = abs(start)
    else:
        shrinking = max(0.0, abs(start) - abs(target))
    if shrinking >= down:
        return down / change
    return min(1.0, (shrinking + (1.0 - shrinking / down) * up) / change)
