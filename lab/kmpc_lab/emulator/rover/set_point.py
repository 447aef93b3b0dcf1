"""Set-points as ArduPilot's rover reads SET_POSITION_TARGET_LOCAL_NED."""

from __future__ import annotations

import math
from dataclasses import dataclass

FRAMES_LOCAL, FRAMES_BODY = (1, 7), (8, 9)
FRAMES = FRAMES_LOCAL + FRAMES_BODY
"""Coordinate frames that are accepted; others, such as 12, are ignored."""
POS_IGNORE, VEL_IGNORE, ACC_IGNORE, YAW_IGNORE, YAW_RATE_IGNORE = 0x003, 0x018, 0x0C0, 0x400, 0x800
"""Bits of a type mask: one of a kind is enough to drop the kind."""


@dataclass(frozen=True)
class Target:
    """A set-point in GUIDED: a speed, with a turn rate or a heading."""

    speed: float
    """[m/s]"""
    turn: float | None
    """Counter-clockwise [rad/s]; None to steer to the heading."""
    heading: float
    """[rad], ENU."""
    uptime: float
    """When it came [s]."""


@dataclass(frozen=True)
class SetPoint:
    """What one message asks for: m/s, rad, and rad/s clockwise (all NED)."""

    frame: int
    mask: int
    velocity: tuple[float, float]
    yaw: float
    yaw_rate: float

    @property
    def _ignores_velocity(self) -> bool:
        return bool(self.mask & VEL_IGNORE)

    @property
    def _ignores_yaw(self) -> bool:
        return bool(self.mask & YAW_IGNORE)

    @property
    def _ignores_rate(self) -> bool:
        return bool(self.mask & YAW_RATE_IGNORE)

    @property
    def finite(self) -> bool:
        """Whether all numbers that the mask asks for are."""
        used = (
            (() if self._ignores_velocity else self.velocity)
            + (() if self._ignores_yaw else (self.yaw,))
            + (() if self._ignores_rate else (self.yaw_rate,))
        )
        return all(map(math.isfinite, used))

    @property
    def understood(self) -> bool:
        """Whether it asks for a speed or a turn, and for nothing that is not emulated."""
        one_turn = self._ignores_yaw or self._ignores_rate
        nothing = self._ignores_velocity and self._ignores_yaw and self._ignores_rate
        return bool(self.mask & ACC_IGNORE and self.mask & POS_IGNORE and one_turn and not nothing)

    def target(self, theta: float, limit: float, uptime: float) -> Target:
        """What the rover does then: at a heading [rad, ENU], with a limit of its speed [m/s]."""
        body = self.frame in FRAMES_BODY
        speed, heading = 0.0, theta
        if not self._ignores_velocity:
            north, east = self.velocity
            backwards = north < 0.0 and not (self._ignores_yaw and self._ignores_rate)
            speed = min(math.hypot(north, east), limit) * (-1.0 if backwards else 1.0)
            angle = -math.atan2(east, north)
            heading = theta + angle if body else math.pi / 2.0 + angle
        if not self._ignores_yaw:
            heading = theta - self.yaw if body else math.pi / 2.0 - self.yaw
        return Target(speed, None if self._ignores_rate else -self.yaw_rate, heading, uptime)
