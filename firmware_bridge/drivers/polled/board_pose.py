"""The pose that a board's counters give, and whether it can be true."""

from __future__ import annotations

import math

from firmware_bridge.kinematics import Geometry
from firmware_bridge.messages import State
from firmware_bridge.odometry import WheelOdometry

JUMP_SHOWN = 1.0
"""How long a jump of the counters makes the pose count as untrue [s]."""
ABSURD = 5.0
"""Speeds beyond this multiple of the limit are refused."""


class BoardPose:
    """Newest state from counters and speeds of all channels.

    `geometry`: of the robot. `odometry`: fits the board's counters.
    """

    def __init__(self, geometry: Geometry, odometry: WheelOdometry) -> None:
        self._geometry, self._odometry = geometry, odometry
        self._jumped = self._restarted = -math.inf
        self.state: State | None = None
        """Newest state; None before the first counters."""

    @property
    def stamp(self) -> float:
        """When the newest state was measured [s]; minus infinity before the first."""
        return self.state.stamp if self.state is not None else -math.inf

    def jumped(self, now: float) -> bool:
        """Whether the counters have jumped lately."""
        return now - self._jumped < JUMP_SHOWN

    def restarted(self, now: float) -> bool:
        """Whether the board was restarted lately."""
        return now - self._restarted < JUMP_SHOWN

    @property
    def beginnings(self) -> int:
        """How often the counters themselves showed that the board was restarted."""
        return self._odometry.beginnings

    def rebase(self, now: float) -> None:
        """Go on from new counters: the distance rolled meanwhile is unknown."""
        self._odometry.rebase()
        self._jumped = now

    def note_restart(self, now: float) -> None:
        """Remember that the board was restarted."""
        self._restarted = now

    def plausible(self, counts: tuple[float, ...], speeds: tuple[float, ...]) -> bool:
        """Whether wheels can do that: counts, and speeds [motor turns/s]."""
        fastest = (ABSURD * self._geometry.max_wheel_speed + 1.0) / self._geometry.wheel_radius
        finite = all(map(math.isfinite, counts))
        return finite and all(abs(w) <= fastest for w in self._geometry.from_channels(*speeds))

    def move(
        self, counts: tuple[float, ...], speeds: tuple[float, ...], stamp: float, curvature: float
    ) -> bool:
        """Take counts and speeds [motor turns/s] in; False, without a move, where they jumped.

        A car drives in a curvature [1/m].
        """
        if not self._odometry.update(counts, stamp, speeds, curvature):
            self._jumped = stamp
            return False
        v, omega, vy = self._geometry.body(self._geometry.from_channels(*speeds), curvature)
        odometry = self._odometry
        self.state = State(odometry.x, odometry.y, odometry.theta, v, omega, stamp, vy)
        return True
