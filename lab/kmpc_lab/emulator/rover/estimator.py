"""The emulated autopilot's pose: from GPS, or from motion capture that may fall silent."""

from __future__ import annotations

import math
import random

from kmpc_lab.emulator.rover.parameters import Parameters
from kmpc_lab.emulator.rover.physics import RoverPhysics

GOOD = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512
"""EKF_STATUS_REPORT: attitude, velocities, positions and their predictions."""
LOST = 1 | 4 | 32 | 128
"""Attitude and height only, horizontal position held constant."""
UNINITIALIZED = 1024
LOOKS_VALID = 7.0
"""How long the pose looks valid after motion capture has stopped, as measured [s]."""
FED = 0.25
"""Motion capture must come at least this often to be taken for the first time [s]."""
WANDER = 8.0
"""Time constant of the position's slow error [s]: with 1 cm it moves by 1.6 mm in 0.1 s, what a
model's one-step error on the firmware has more than on an emulator without; the firmware's position
was 1 to 4 cm off."""
ORIGIN = (47.3769, 8.5417, 408.0)
"""Where the GPS is: latitude, longitude [deg], altitude [m]."""


class Estimator:
    """Pose estimate, ENU, and its flags.

    `parameters`: say where the pose comes from. `settled`: when after boot the EKF has its position
    and, with GPS, its origin [s]. `noise`: with GPS: standard deviation of a slow error of the
    position, each axis [m]. `seed`: of that error.
    """

    def __init__(
        self, parameters: Parameters, settled: float, noise: float = 0.0, seed: int = 0
    ) -> None:
        self._noise, self._random = noise, random.Random(seed)
        self._error = (0.0, 0.0)
        self._parameters, self._settled = parameters, settled
        self.origin: tuple[float, float, float] | None = None
        self.pose = (0.0, 0.0, 0.0)
        """x, y [m], theta [rad]."""
        self.broken = False
        """Set by a test: the filter has lost its position."""
        self._uptime, self._fed, self._ever = 0.0, -math.inf, False

    def vision(self, x: float, y: float, theta: float, uptime: float) -> None:
        """Take a pose from outside, where one is wanted."""
        if self._parameters.motion_capture and all(map(math.isfinite, (x, y, theta))):
            self._ever = self._ever or (uptime - self._fed <= FED and self.origin is not None)
            self._fed, self.pose = uptime, (x, y, theta)

    def step(self, physics: RoverPhysics, uptime: float, dt: float) -> None:
        """Follow the rover: with GPS all but a slow error, else its motion since the last pose."""
        self._uptime = uptime
        if not self._parameters.motion_capture:
            self.pose = self._wander(*physics.pose, dt)
            if uptime >= self._settled and self.origin is None:
                self.origin = ORIGIN
            return
        x, y, theta = self.pose
        # the motion is measured in the body's frame, which the estimate may have turned
        turned = theta - physics.pose[2]
        east, north, turn = physics.velocity
        x += (east * math.cos(turned) - north * math.sin(turned)) * dt
        y += (east * math.sin(turned) + north * math.cos(turned)) * dt
        self.pose = (x, y, theta + turn * dt)

    def _wander(self, x: float, y: float, theta: float, dt: float) -> tuple[float, float, float]:
        """Put the slow error on a pose."""
        if not self._noise:
            return x, y, theta
        kick = self._noise * math.sqrt(2.0 * dt / WANDER)
        east, north = (
            error * (1.0 - dt / WANDER) + self._random.gauss(0.0, kick) for error in self._error
        )
        self._error = (east, north)
        return x + east, y + north, theta

    @property
    def position_ok(self) -> bool:
        """Whether a position is known: LOCAL_POSITION_NED goes out, GUIDED may be entered."""
        if self.broken or self.origin is None or self._uptime < self._settled:
            return False
        return not self._parameters.motion_capture or (
            self._ever and self._uptime - self._fed <= LOOKS_VALID
        )

    @property
    def flags(self) -> int:
        """Flags of EKF_STATUS_REPORT."""
        if self._uptime < min(1.0, self._settled):
            return UNINITIALIZED
        return GOOD if self.position_ok else LOST
