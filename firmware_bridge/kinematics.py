"""Body speeds <-> wheel speeds, and odometry from wheel counters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.options import bounded, check

WRAP = 2**32
AGREE = 3
"""So many counters in a row that agree with each other, and not with those before, are a new
beginning."""


@dataclass(frozen=True)
class WheelGeometry:
    """A robot with a left and a right wheel (or side), each on its own motor.

    Examples
    --------
    >>> rosbot = WheelGeometry(wheel_radius=0.0425, track=0.27, max_wheel_speed=0.9)
    >>> left, right = rosbot.wheels(0.4, 1.0)
    >>> v, omega = rosbot.body(left, right)
    >>> round(v, 9), round(omega, 9)
    (0.4, 1.0)
    """

    wheel_radius: float = bounded(1e-3, 10.0, "m")
    """[m]"""
    track: float = bounded(1e-2, 100.0, "m")
    """Effective distance between the wheels [m]; skid-steer robots: 1.3 to 2 times the measured
    one."""
    max_wheel_speed: float = bounded(1e-3, 100.0, "m/s")
    """At the rim [m/s]. Faster commands are scaled down on both sides, which keeps the
    curvature."""
    gear_ratio: float = bounded(1e-3, 1e4, "", 1.0)
    """Motor turns per wheel turn."""
    invert_left: bool = False
    """The left motor turns backwards for positive commands."""
    invert_right: bool = False
    swap: bool = False
    """The right wheel is on the board's first channel."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)

    def wheels(self, v: float, omega: float) -> tuple[float, float]:
        """Wheel speeds (left, right) [rad/s] for v [m/s] and omega [rad/s].

        Beyond the limit both are scaled, so that the curvature stays.

        Raises
        ------
        ValueError
            If v or omega is not finite.
        """
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise ValueError(f"expected finite speeds, got v = {v}, omega = {omega}")
        huge = max(abs(v), abs(omega)) / 1e6  # so that nothing overflows on its way to the limit
        if huge > 1.0:
            v, omega = v / huge, omega / huge
        left, right = v - omega * self.track / 2.0, v + omega * self.track / 2.0
        largest = max(abs(left), abs(right))
        scale = self.max_wheel_speed / largest if largest > self.max_wheel_speed else 1.0
        return left * scale / self.wheel_radius, right * scale / self.wheel_radius

    def body(self, left: float, right: float) -> tuple[float, float]:
        """Body speeds v [m/s] and omega [rad/s] of wheel speeds [rad/s]."""
        return self.wheel_radius * (left + right) / 2.0, self.wheel_radius * (
            right - left
        ) / self.track

    def to_channels(self, left: float, right: float) -> tuple[float, float]:
        """Motor turns per second of the board's two channels, from wheel speeds [rad/s]."""
        factor = self.gear_ratio / math.tau
        left, right = (
            factor * (-left if self.invert_left else left),
            factor * (-right if self.invert_right else right),
        )
        return (right, left) if self.swap else (left, right)

    def from_channels(self, first: float, second: float) -> tuple[float, float]:
        """Wheels (left, right) [rad or rad/s] from motor turns (per second) of both channels."""
        left, right = (second, first) if self.swap else (first, second)
        factor = math.tau / self.gear_ratio
        return factor * (-left if self.invert_left else left), factor * (
            -right if self.invert_right else right
        )


def wrapped(difference: float) -> float:
    """Difference of two int32 counters that may have wrapped round in between.

    Examples
    --------
    >>> wrapped(-2**31 - (2**31 - 1))
    1
    """
    return (difference + WRAP // 2) % WRAP - WRAP // 2


class WheelOdometry:
    """Pose from the counters of both channels, along exact arcs.

    Parameters
    ----------
    geometry : WheelGeometry
        Of the robot.
    counts_per_turn : float
        Counts per motor turn.
    wraps : bool
        Whether the counters are int32 that wrap round.
    """

    def __init__(self, geometry: WheelGeometry, counts_per_turn: float, wraps: bool) -> None:
        self._geometry, self._counts_per_turn, self._wraps = geometry, counts_per_turn, wraps
        self._last: tuple[float, float, float] | None = None
        self._doubted: tuple[float, float, float] | None = None
        self._agreed = 0
        self.x = self.y = self.theta = 0.0
        """[m], [m], [rad] in (-pi, pi]"""
        self.turned = (0.0, 0.0)
        """How far the wheels (left, right) turned in the last step [rad]."""

    @property
    def count(self) -> float:
        """How far a wheel turns in a count [rad]."""
        return math.tau / (self._counts_per_turn * self._geometry.gear_ratio)

    def rebase(self) -> None:
        """Forget the counters: the next ones are a new beginning at the same pose."""
        self._last = self._doubted = None

    def update(self, first: float, second: float, stamp: float) -> bool:
        """Move by what the counters say; False, without a move, for steps that no wheel can take.

        A damaged reply makes such a jump, and the next counters go on from those before it. A board
        that was switched off and on makes one too, and the next counters go on from there.
        """
        now = (first, second, stamp)
        if self._last is None:
            self._last, self.turned = now, (0.0, 0.0)
            return True
        wheels = self._turned(self._last, now)
        follows = self._doubted is not None and self._turned(self._doubted, now) is not None
        if wheels is None or follows:
            self._doubted, self._agreed = now, self._agreed + 1 if follows else 1
            if self._agreed >= AGREE:
                self._last, self._doubted = now, None
            return False
        self._last, self._doubted, self.turned = now, None, wheels
        forward, turn = self._geometry.body(*wheels)
        half = turn / 2.0
        chord = forward * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
        self.x += chord * math.cos(self.theta + half)
        self.y += chord * math.sin(self.theta + half)
        self.theta = math.remainder(self.theta + turn, math.tau)
        return True

    def _turned(
        self, before: tuple[float, float, float], now: tuple[float, float, float]
    ) -> tuple[float, float] | None:
        """How far the wheels (left, right) turned [rad]; None where no wheel can have."""
        steps = (now[0] - before[0], now[1] - before[1])
        if self._wraps:
            steps = (wrapped(steps[0]), wrapped(steps[1]))
        left, right = self._geometry.from_channels(
            steps[0] / self._counts_per_turn, steps[1] / self._counts_per_turn
        )
        reach = (
            2.0 * self._geometry.max_wheel_speed * max(0.0, now[2] - before[2]) + 0.02
        ) / self._geometry.wheel_radius
        return (left, right) if abs(left) <= reach and abs(right) <= reach else None
