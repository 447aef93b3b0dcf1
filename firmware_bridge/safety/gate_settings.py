"""Settings of the safety gate: speed limits, how late its inputs may be, how long it waits.

One factor scales all speeds, to keep the curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from firmware_bridge.messages import ConfigError, Speeds
from firmware_bridge.options import bounded, check

STANDS = 1e-3  # speed that no wheel drives [m/s, rad/s]
ZERO = 1e-9  # speeds below this [m/s, rad/s] are zero
TICK = 0.02
"""Period of the gate [s]: a lost input is noticed at most this much late, and stops are sent this
often."""


@dataclass(frozen=True)
class Limits:
    """What a command may be; the defaults are slow on purpose.

    Raises ConfigError: names the limit that is out of range.
    """

    v_max: float = bounded(1e-4, 100.0, "m/s", 0.3)  # forward [m/s]
    v_reverse: float = bounded(0.0, 100.0, "m/s", 0.3)
    """Backwards [m/s]; 0 for a robot that must not."""
    omega_max: float = bounded(1e-4, 100.0, "rad/s", 0.8)  # either way [rad/s]
    acceleration: float = bounded(1e-3, 1e3, "m/s^2", 1.0)  # away from zero [m/s^2]
    deceleration: float = bounded(1e-3, 1e3, "m/s^2", 1.0)  # towards zero [m/s^2]
    angular_acceleration: float = bounded(1e-3, 1e4, "rad/s^2", 4.0)  # away from zero [rad/s^2]
    angular_deceleration: float = bounded(1e-3, 1e4, "rad/s^2", 4.0)  # towards zero [rad/s^2]
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


@dataclass(frozen=True)
class GateSettings:
    """Settings of a gate.

    Raises ConfigError: names the setting that is wrong.
    """

    limits: Limits = field(default_factory=Limits)
    watchdog: float = bounded(0.01, 60.0, "s", 0.25)  # oldest controller output that is sent [s]
    pose_age: float = bounded(0.01, 60.0, "s", 0.25)
    """Oldest pose to drive on [s]: the robot is slowed from `slow_from` of it on, and brakes past
    it."""
    scan_age: float = bounded(0.01, 60.0, "s", 0.5)
    """Oldest scan to drive on, for a robot with a lidar [s]: as `pose_age`."""
    heartbeat_age: float = bounded(0.01, 60.0, "s", 0.25)  # how long the board may be silent [s]
    hold: float = bounded(0.01, 60.0, "s", 1.0)  # how long zeros are sent before the release [s]
    settle: float = bounded(0.01, 60.0, "s", 0.5)
    """How long nothing may be wrong before the robot drives (again) [s]."""
    slow_from: float = bounded(0.0, 1.0, "(a share)", 0.6)
    """Share of `watchdog`, `pose_age` and `scan_age` from which on the robot is slowed, down to
    zero at the whole; 1 slows nothing."""
    unmoved: float = bounded(0.0, 60.0, "s", 1.0)
    """How long after a command to drive the pose may stay the same [s]; 0: for ever,
    for a robot on blocks whose pose does not come from its wheels."""
    resume: float = bounded(0.0, 60.0, "s", 0.0)
    """How long a robot that stands may wait for a lost pose, and then drive on by itself [s]; 0:
    no longer than `hold`."""
    resume_within: float = bounded(0.0, 100.0, "m", 0.5)
    """A pose that comes back farther from where it was lost than this is not driven on [m]."""
    geofence: tuple[float, float, float, float] | None = None
    """xmin, ymin, xmax, ymax [m]: outside the robot stops, and is given back."""
    pilot: bool = True
    """Whether a pilot can take the robot, as by an autopilot's mode. If not, a
    board that is not ready is a fault."""

    def __post_init__(self) -> None:
        """Check the ranges and the fence."""
        check(self)
        if self.geofence is not None:
            numbers = [
                x
                for x in self.geofence
                if not isinstance(x, bool) and isinstance(x, int | float) and math.isfinite(x)
            ]
            if (
                len(self.geofence) != 4
                or len(numbers) != 4
                or numbers[0] >= numbers[2]
                or numbers[1] >= numbers[3]
            ):
                raise ConfigError(
                    "geofence: expected [xmin, ymin, xmax, ymax] in m with xmin < xmax and ymin "
                    f"< ymax, got {self.geofence!r}"
                )
