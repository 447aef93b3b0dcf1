"""Body speeds <-> wheel speeds, and odometry from wheel counters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check

WRAP = 2**32
AGREE = 3
"""So many counters in a row that agree with each other, and not with those before, are a new
beginning."""
SLACK, SHARE = 0.02, 0.1
"""A wheel's step may differ from what its speeds before and after say by this [m], and by this
share of it: stamps are late, and speeds are filtered."""
ROLLS = 0.5
"""A robot whose board restarts is taken to roll on for no longer than this [s]."""


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
        """Check the ranges, and that no wheel seems to be given in centimetres."""
        check(self)
        if self.wheel_radius > self.track:
            raise ConfigError(
                f"wheel_radius: expected at most the track of {self.track:g} m, "
                f"got {self.wheel_radius:g} m"
            )

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
        left = factor * (-left if self.invert_left else left)
        right = factor * (-right if self.invert_right else right)
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


@dataclass(frozen=True)
class Reading:
    """What a board said of both channels at a time."""

    counts: tuple[float, float]
    stamp: float
    """[s]"""
    speeds: tuple[float, float] | None
    """Of the wheels (left, right) [rad/s]; None if the board does not tell."""


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
        self._last: Reading | None = None
        self._doubted: Reading | None = None
        self._first: Reading
        self._agreed = 0
        self.x = self.y = self.theta = 0.0
        """[m], [m], [rad] in (-pi, pi]"""
        self.turned = (0.0, 0.0)
        """How far the wheels (left, right) turned in the last step [rad]."""
        self.beginnings = 0
        """How often the counters went on elsewhere than they were: the board was restarted."""

    @property
    def count(self) -> float:
        """How far a wheel turns in a count [rad]."""
        return math.tau / (self._counts_per_turn * self._geometry.gear_ratio)

    def rebase(self) -> None:
        """Forget the counters: the next ones are a new beginning at the same pose."""
        if self._doubted is None or self._last is None:
            self._last = self._doubted = None
        else:  # they have been seen
            self._begin(self._last)

    def update(
        self,
        first: float,
        second: float,
        stamp: float,
        speeds: tuple[float, float] | None = None,
    ) -> bool:
        """Move by what the counters say; False, without a move, for steps that no wheel can take.

        A damaged reply makes such a jump, and the next counters go on from those before it. A board
        that was switched off and on makes one too, and the next counters go on from there. `speeds`
        of both channels [motor turns/s] tell the way back to zero of such a board from a robot that
        drives backward, however long nobody asked it.
        """
        wheel_speeds = None if speeds is None else self._geometry.from_channels(*speeds)
        now = Reading((first, second), stamp, wheel_speeds)
        if self._last is None:
            self._last, self.turned = now, (0.0, 0.0)
            return True
        wheels = self._turned(self._last, now)
        follows = self._doubted is not None and self._turned(self._doubted, now) is not None
        if wheels is None or follows:
            if not follows:
                self._first = now
            self._doubted, self._agreed = now, self._agreed + 1 if follows else 1
            if self._agreed >= AGREE:
                self._begin(self._last)
                self.beginnings += 1
            return False
        self._last, self._doubted, self.turned = now, None, wheels
        self._move(wheels)
        return True

    def _begin(self, before: Reading) -> None:
        """Go on from the first counters that do not follow those before."""
        self._move(self._rolled(before, self._first))
        self._last, self._doubted = self._first, None

    def _rolled(self, before: Reading, now: Reading) -> tuple[float, float]:
        """How far the wheels (left, right) turned by their speeds alone, at a restart [rad]."""
        if before.speeds is None or now.speeds is None:
            return 0.0, 0.0
        half = min(max(0.0, now.stamp - before.stamp), ROLLS) / 2.0
        left, right = (half * (a + b) for a, b in zip(before.speeds, now.speeds, strict=True))
        return left, right

    def _move(self, wheels: tuple[float, float]) -> None:
        """Go on along the arc of what the wheels (left, right) turned [rad]."""
        forward, turn = self._geometry.body(*wheels)
        half = turn / 2.0
        chord = forward * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
        self.x += chord * math.cos(self.theta + half)
        self.y += chord * math.sin(self.theta + half)
        self.theta = math.remainder(self.theta + turn, math.tau)

    def _turned(self, before: Reading, now: Reading) -> tuple[float, float] | None:
        """How far the wheels (left, right) turned [rad]; None if no wheel can have."""
        first, second = now.counts[0] - before.counts[0], now.counts[1] - before.counts[1]
        if self._wraps:
            first, second = wrapped(first), wrapped(second)
        left, right = self._wheels(first, second)
        dt = max(0.0, now.stamp - before.stamp)
        reach = (2.0 * self._geometry.max_wheel_speed * dt + SLACK) / self._geometry.wheel_radius
        if not (abs(left) <= reach and abs(right) <= reach):
            return None
        return None if self._from_zero(before, now, (left, right), dt) else (left, right)

    def _from_zero(
        self, before: Reading, now: Reading, steps: tuple[float, float], dt: float
    ) -> bool:
        """Whether the speeds explain counters that began anew at zero, and not these steps."""
        if before.speeds is None or now.speeds is None:
            return False
        since_zero, until = self._wheels(*now.counts), self._wheels(*before.counts)
        for wheel, step in enumerate(steps):  # perhaps only one was read after the restart
            ends = before.speeds[wheel] * dt, now.speeds[wheel] * dt
            slack = SLACK / self._geometry.wheel_radius + SHARE * max(map(abs, ends))
            back = abs(since_zero[wheel]) < abs(until[wheel])
            anew = back and _outside(since_zero[wheel], (*ends, 0.0)) <= slack
            if anew and _outside(step, ends) > slack:
                return True
        return False

    def _wheels(self, first: float, second: float) -> tuple[float, float]:
        """Wheels (left, right) [rad] of counts of both channels."""
        return self._geometry.from_channels(
            first / self._counts_per_turn, second / self._counts_per_turn
        )


def _outside(value: float, bounds: tuple[float, ...]) -> float:
    """How far a value lies outside of what some numbers span."""
    return max(min(bounds) - value, value - max(bounds), 0.0)
