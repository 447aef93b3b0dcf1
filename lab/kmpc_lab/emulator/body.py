"""The robot under an emulated board: lagging motors, wheels, floor, in steps of a given clock."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from firmware_bridge.kinematics import WheelGeometry
from kmpc_lab.sim.plants.robots import DifferentialDrive

STEP = 0.01
"""[s]"""
TOP = 3.0
"""Motors go no faster than so many times the robot's limit."""
COAST = 0.4
"""Time constant of a motor that is let go [s]."""
STILL = 1e-3
"""Slower wheels stand [rad/s]."""


class Body:
    """Two wheels and a pose.

    Parameters
    ----------
    geometry : WheelGeometry
        Of the robot.
    slip, turn_gain, seed
        Of the floor: see `kmpc_lab.sim.plants.robots.DifferentialDrive`.
    lag : float
        Time constant of the driven motors [s].
    now : float
        Time of the clock at the start [s].
    """

    def __init__(
        self,
        geometry: WheelGeometry,
        slip: float,
        turn_gain: float,
        seed: int,
        lag: float,
        now: float,
    ) -> None:
        self._geometry, self._lag = geometry, lag
        self._floor = DifferentialDrive(slip=slip, seed=seed, turn_gain=turn_gain)
        self._start, self._steps = now, 0
        self._top = (
            TOP * geometry.max_wheel_speed / geometry.wheel_radius * geometry.gear_ratio / math.tau
        )
        self._pose = np.zeros(3)
        self.command = [0.0, 0.0]
        """Set-points of both channels, motor turns per second."""
        self.driven = [True, True]
        self.ramp = math.inf
        """How fast the motors approach their set-points [turns/s^2]."""
        self.speeds = [0.0, 0.0]
        """Motor turns per second."""
        self._ramped = [0.0, 0.0]
        self.turns = [0.0, 0.0]
        """Motor turns since the start."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m] and theta [rad], not wrapped."""
        return float(self._pose[0]), float(self._pose[1]), float(self._pose[2])

    def turned(self, channel: int, now: float) -> float:
        """Motor turns at `now`, between two steps too: encoders know no steps."""
        return self.turns[channel] + self.speeds[channel] * max(
            0.0, now - self._start - self._steps * STEP
        )

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down somewhere."""
        self._pose = np.array((x, y, theta))

    def advance(self, now: float, watchdog: Callable[[float], None]) -> None:
        """Step up to `now`; `watchdog` is called with the time before each step, and at the end."""
        last = math.floor((now - self._start) / STEP)
        while self._steps < last:
            if not any(self.command) and not any(self.speeds) and not any(self._ramped):
                self._steps = last  # nothing moves
                break
            watchdog(self._start + self._steps * STEP)
            self._step()
            self._steps += 1
        watchdog(now)

    def _step(self) -> None:
        for i in (0, 1):
            change = min(max(self.command[i], -self._top), self._top) - self._ramped[i]
            self._ramped[i] += math.copysign(min(abs(change), self.ramp * STEP), change)
            target, lag = (self._ramped[i], self._lag) if self.driven[i] else (0.0, COAST)
            speed = target + (self.speeds[i] - target) * (math.exp(-STEP / lag) if lag else 0.0)
            if target == 0.0 and abs(speed) * math.tau < STILL:
                speed = 0.0
            self.turns[i] += (self.speeds[i] + speed) / 2.0 * STEP
            self.speeds[i] = speed
        v, omega = self._geometry.body(*self._geometry.from_channels(*self.speeds))
        self._pose = self._floor.step(self._pose, (v, omega), STEP)
