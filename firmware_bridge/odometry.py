"""Odometry from the counters of a board's motors, along exact arcs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.kinematics import CarGeometry, Geometry

WRAP = 2**32
AGREE = 3
"""So many counters in a row that agree with each other, and not with those before, are a new
beginning."""
SLACK, SHARE = 0.02, 0.1
"""A wheel's step may differ from what its speeds before and after say by this [m], and by this
share of it: stamps are late, and speeds are filtered."""
ROLLS = 0.5  # a robot whose board restarts is taken to roll on for no longer than this [s]


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
    """What a board said of its channels at a time."""

    counts: tuple[float, ...]
    stamp: float  # [s]
    speeds: tuple[float, ...] | None  # of the wheels [rad/s]; None if the board does not tell


class WheelOdometry:
    """Pose from the counters of all channels, along exact arcs.

    Parameters
    ----------
    geometry : Geometry
        Of the robot.
    counts_per_turn : float
        Counts per motor turn.
    wraps : bool
        Whether the counters are int32 that wrap round.
    """

    def __init__(self, geometry: Geometry, counts_per_turn: float, wraps: bool) -> None:
        self._geometry, self._counts_per_turn, self._wraps = geometry, counts_per_turn, wraps
        self._last: Reading | None = None
        self._doubted: Reading | None = None
        self._first: Reading
        self._agreed = 0
        self.x = self.y = self.theta = 0.0  # [m], [m], [rad] in (-pi, pi]
        self.turned: tuple[float, ...] = geometry.still
        """How far the wheels turned in the last step [rad]."""
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
            self._begin(self._last, 0.0)

    def update(
        self,
        counts: tuple[float, ...],
        stamp: float,
        speeds: tuple[float, ...] | None = None,
        curvature: float = 0.0,
    ) -> bool:
        """Move by what the counters say; False, without a move, for steps that no wheel can take.

        A damaged reply makes such a jump, and the next counters go on from those before it. A board
        that was switched off and on makes one too, and the next counters go on from there. `speeds`
        of the channels [motor turns/s] tell the way back to zero of such a board from a robot that
        drives backward, however long nobody asked it. A car drives along its `curvature` [1/m].
        """
        wheel_speeds = None if speeds is None else self._geometry.from_channels(*speeds)
        now = Reading(counts, stamp, wheel_speeds)
        if self._last is None:
            self._last, self.turned = now, self._geometry.still
            return True
        wheels = self._turned(self._last, now)
        follows = self._doubted is not None and self._turned(self._doubted, now) is not None
        if wheels is None or follows:
            if not follows:
                self._first = now
            self._doubted, self._agreed = now, self._agreed + 1 if follows else 1
            if self._agreed >= AGREE:
                self._begin(self._last, curvature)
                self.beginnings += 1
            return False
        self._last, self._doubted, self.turned = now, None, wheels
        self._move(wheels, curvature)
        return True

    def _begin(self, before: Reading, curvature: float) -> None:
        """Go on from the first counters that do not follow those before."""
        self._move(self._rolled(before, self._first), curvature)
        self._last, self._doubted = self._first, None

    def _rolled(self, before: Reading, now: Reading) -> tuple[float, ...]:
        """How far the wheels turned by their speeds alone, at a restart [rad]."""
        if before.speeds is None or now.speeds is None:
            return self._geometry.still
        half = min(max(0.0, now.stamp - before.stamp), ROLLS) / 2.0
        return tuple(half * (a + b) for a, b in zip(before.speeds, now.speeds, strict=True))

    def _move(self, wheels: tuple[float, ...], curvature: float) -> None:
        """Go on along the arc of what the wheels turned [rad]."""
        ahead, turn, left = self._geometry.body(wheels, curvature)
        half = turn / 2.0
        chord = math.sin(half) / half if abs(half) > 1e-6 else 1.0
        cos, sin = math.cos(self.theta + half), math.sin(self.theta + half)
        self.x += chord * (ahead * cos - left * sin)
        self.y += chord * (ahead * sin + left * cos)
        self.theta = math.remainder(self.theta + turn, math.tau)

    def _turned(self, before: Reading, now: Reading) -> tuple[float, ...] | None:
        """How far the wheels turned [rad]; None if no wheel can have."""
        steps = tuple(b - a for a, b in zip(before.counts, now.counts, strict=True))
        wheels = self._wheels(tuple(map(wrapped, steps)) if self._wraps else steps)
        dt = max(0.0, now.stamp - before.stamp)
        reach = (2.0 * self._geometry.max_wheel_speed * dt + SLACK) / self._geometry.wheel_radius
        if not all(abs(wheel) <= reach for wheel in wheels):
            return None
        return None if self._from_zero(before, now, wheels, dt) else wheels

    def _from_zero(
        self, before: Reading, now: Reading, steps: tuple[float, ...], dt: float
    ) -> bool:
        """Whether the speeds explain counters that began anew at zero, and not these steps."""
        if before.speeds is None or now.speeds is None:
            return False
        since_zero, until = self._wheels(now.counts), self._wheels(before.counts)
        for wheel, step in enumerate(steps):  # perhaps only one was read after the restart
            ends = before.speeds[wheel] * dt, now.speeds[wheel] * dt
            slack = SLACK / self._geometry.wheel_radius + SHARE * max(map(abs, ends))
            back = abs(since_zero[wheel]) < abs(until[wheel])
            anew = back and _outside(since_zero[wheel], (*ends, 0.0)) <= slack
            if anew and _outside(step, ends) > slack:
                return True
        return False

    def _wheels(self, counts: tuple[float, ...]) -> tuple[float, ...]:
        """Wheels [rad] of counts of the channels."""
        return self._geometry.from_channels(*(count / self._counts_per_turn for count in counts))


def _outside(value: float, bounds: tuple[float, ...]) -> float:
    """How far a value lies outside of what some numbers span."""
    return max(min(bounds) - value, value - max(bounds), 0.0)


class Steering:
    """Where a car's wheels are commanded to be steered, and where they have come by then.

    Nothing is heard of a servo: it is taken to follow as fast as the robot file says.

    `geometry`: of the car.

    Examples
    --------
    >>> car = CarGeometry(wheel_radius=0.05, max_wheel_speed=2.0, wheelbase=0.3,
    ...                   steering_angle=0.5, steering_rate=2.0)
    >>> steering = Steering(car)
    >>> steering.command(1.0, 1.0, now=10.0)
    >>> steering.at(10.25), steering.at(11.0)
    (0.5, 1.0)
    """

    def __init__(self, geometry: CarGeometry) -> None:
        self._geometry = geometry
        self.wanted = 0.0  # commanded curvature [1/m]
        self._curvature, self._stamp = 0.0, -math.inf

    @property
    def share(self) -> float:
        """Commanded angle, as a share of the largest, to the left."""
        return self._geometry.angle(self.wanted) / self._geometry.steering_angle

    def command(self, v: float, omega: float, now: float) -> None:
        """Steer towards a command [m/s, rad/s], given at a time [s]."""
        self._curvature, self._stamp = self.at(now), now
        self.wanted = self._geometry.steer(v, omega, self.wanted)

    def at(self, now: float) -> float:
        """Curvature [1/m] at a time [s]."""
        if self._geometry.steering_rate is None:
            return self.wanted
        change, most = self.wanted - self._curvature, self._geometry.steering_rate
        most *= max(0.0, now - self._stamp)
        return self._curvature + math.copysign(min(abs(change), most), change)
