"""Settings of the safety gate: speed limits, how late its inputs may be, how long it waits."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check
from firmware_bridge.safety.limits import Limits

TICK = 0.02
"""Period of the gate [s]: a lost input is noticed at most this much late, and stops are sent this
often."""


@dataclass(frozen=True)
class GateSettings:
    """Settings of a gate.

    Raises ConfigError: names the setting that is wrong.
    """

    limits: Limits = field(default_factory=Limits)
    watchdog: float = bounded(0.01, 60.0, "s", 0.25)
    """Oldest controller output that is sent [s]."""
    pose_age: float = bounded(0.01, 60.0, "s", 0.25)
    """Oldest pose to drive on [s]: the robot is slowed from `slow_from` of it on, and brakes past
    it."""
    scan_age: float = bounded(0.01, 60.0, "s", 0.5)
    """Oldest scan to drive on, for a robot with a lidar [s]: as `pose_age`."""
    heartbeat_age: float = bounded(0.01, 60.0, "s", 0.25)
    """How long the board may be silent [s]."""
    hold: float = bounded(0.01, 60.0, "s", 1.0)
    """How long zeros are sent before the release [s]."""
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
