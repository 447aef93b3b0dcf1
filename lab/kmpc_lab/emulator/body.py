"""The robot under an emulated board: motors that lag, perhaps a car's servo, and a floor."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from firmware_bridge.kinematics import CarGeometry, Geometry, OmniGeometry
from firmware_bridge.messages import command_of
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.sim.plants.steered import MecanumDrive, SteeredDrive
from kmpc_lite.control.wheels import Car

STEP = 0.01
"""[s]"""
TOP = 3.0
"""Motors go no faster than so many times the robot's limit."""
COAST = 0.4
"""Time constant of a motor that is let go [s]."""
SERVO = 0.3
"""From lock to lock a car's servo takes at least so long [s]."""
UNDERSTEER = 0.5
"""Of a car, for each 1 of the floor's slip ratio [s^2/m^2]."""
STILL = 1e-3
"""Slower wheels stand [rad/s]."""


class Floor(Protocol):
    """What the wheels roll on: `kmpc_lab.sim.plants`."""

    def trace(self, x: Any, u: Any, dt: float, substeps: int) -> Any:
        """States (substeps, 3) during one period."""


class Body:
    """Wheels and a pose.

    `geometry`: of the robot. `slip`, `turn_gain`, `seed`: of the floor: see `kmpc_lab.sim.plants`.
    `lag`: time constant of the driven motors [s]. `now`: time of the clock at the start [s].
    """

    def __init__(
        self, geometry: Geometry, slip: float, turn_gain: float, seed: int, lag: float, now: float
    ) -> None:
        self._geometry, self._lag = geometry, lag
        self._floor, self._turn_gain = _floor(geometry, slip, seed), turn_gain
        self._start, self._steps = now, 0
        self._top = (
            TOP * geometry.max_wheel_speed / geometry.wheel_radius * geometry.gear_ratio / math.tau
        )
        self._pose = np.zeros(3)
        self.command = list(geometry.still)
        """Set-points of the channels, motor turns per second."""
        self.driven = [True] * len(self.command)
        self.ramp = math.inf
        """How fast the motors approach their set-points [turns/s^2]."""
        self.speeds = list(geometry.still)
        """Motor turns per second."""
        self._ramped = list(geometry.still)
        self.turns = list(geometry.still)
        """Motor turns since the start."""
        self.steered = 0.0
        """Where a car's servo is to be, as a share of its largest angle, to the left."""
        self._curvature = 0.0

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
            moves = any((*self.command, *self.speeds, *self._ramped))
            if not moves and self._wanted == self._curvature:
                self._steps = last  # nothing moves
                break
            watchdog(self._start + self._steps * STEP)
            self._step()
            self._steps += 1
        watchdog(now)

    @property
    def _wanted(self) -> float:
        """Curvature to which a car's servo turns [1/m]."""
        if not isinstance(self._geometry, CarGeometry):
            return 0.0
        return math.tan(self.steered * self._geometry.steering_angle) / self._geometry.wheelbase

    def _steer(self) -> None:
        """Turn a car's servo for a step."""
        if isinstance(self._geometry, CarGeometry):
            fastest = 2.0 * self._geometry.sharpest / SERVO
            most = STEP * min(fastest, self._geometry.steering_rate or fastest)
            change = self._wanted - self._curvature
            self._curvature += min(max(change, -most), most)

    def _step(self) -> None:
        self._steer()
        for i in range(len(self.speeds)):
            change = min(max(self.command[i], -self._top), self._top) - self._ramped[i]
            self._ramped[i] += math.copysign(min(abs(change), self.ramp * STEP), change)
            target, lag = (self._ramped[i], self._lag) if self.driven[i] else (0.0, COAST)
            speed = target + (self.speeds[i] - target) * (math.exp(-STEP / lag) if lag else 0.0)
            if target == 0.0 and abs(speed) * math.tau < STILL:
                speed = 0.0
            self.turns[i] += (self.speeds[i] + speed) / 2.0 * STEP
            self.speeds[i] = speed
        wheels = self._geometry.from_channels(*self.speeds)
        v, omega, vy = self._geometry.body(wheels, self._curvature)
        inputs = 3 if isinstance(self._geometry, OmniGeometry) else 2
        command = command_of((v, self._turn_gain * omega, vy), inputs)
        self._pose = self._floor.trace(self._pose, command, STEP, 1)[-1]


def _floor(geometry: Geometry, slip: float, seed: int) -> Floor:
    """What wheels of a kind roll on."""
    if isinstance(geometry, CarGeometry):
        return SteeredDrive(Car(1.0 / geometry.sharpest), slip, UNDERSTEER * slip, seed=seed)
    if isinstance(geometry, OmniGeometry):
        return MecanumDrive(slip, seed)
    return DifferentialDrive(slip=slip, seed=seed)
