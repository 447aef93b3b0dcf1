"""Limits on commands and on their change; one factor scales both speeds, to keep the curve."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.options import bounded, check

ZERO = 1e-9
"""Speeds below this [m/s, rad/s] are zero."""


@dataclass(frozen=True)
class Limits:
    """What a command may be; the defaults are slow on purpose.

    Raises
    ------
    ConfigError
        Names the limit that is out of range.
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

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)

    def clip(self, v: float, omega: float, share: float = 1.0) -> tuple[float, float]:
        """Scale finite speeds [m/s, rad/s] by one factor until both are within bounds.

        With a `share` below 1 the bounds are that much narrower; slower commands are unchanged.
        """
        v_max, v_reverse, omega_max = (
            share * bound for bound in (self.v_max, self.v_reverse, self.omega_max)
        )
        scale = 1.0
        if v > v_max:
            scale = v_max / v
        elif v < -v_reverse:
            scale = v_reverse / -v
        if abs(omega) * scale > omega_max:
            scale = omega_max / abs(omega)
        return (
            _within(v * scale, -v_reverse, v_max),
            _within(omega * scale, -omega_max, omega_max),
        )

    def slew(
        self,
        start: tuple[float, float],
        target: tuple[float, float],
        dt: float,
        longest_rise: float = math.inf,
    ) -> tuple[float, float]:
        """Move from one command towards another for `dt` [s], on a straight line in (v, omega).

        Away from zero it goes for `longest_rise` [s] at most.
        """
        if dt <= 0.0:
            return start
        rise = min(dt, longest_rise)
        share = min(
            _share(start[0], target[0], self.acceleration * rise, self.deceleration * dt),
            _share(
                start[1],
                target[1],
                self.angular_acceleration * rise,
                self.angular_deceleration * dt,
            ),
        )
        if share >= 1.0:
            return target
        v, omega = (a + share * (b - a) for a, b in zip(start, target, strict=True))
        # on the way to zero only: a slow ramp away from it begins with less
        v = 0.0 if max(abs(v), abs(target[0])) < ZERO else v
        return v, 0.0 if max(abs(omega), abs(target[1])) < ZERO else omega


def _within(value: float, low: float, high: float) -> float:
    """Clip what rounding left outside."""
    return min(max(value, low), high)


def _share(start: float, target: float, up: float, down: float) -> float:
    """Share of the change from `start` to `target` that the limits allow.

    They are `up` away from zero and `down` towards it.
    """
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
