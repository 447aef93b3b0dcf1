"""`kmpc_lite`'s digital twin under an emulated board: what ``--physics mujoco`` puts there."""

from __future__ import annotations

import math

import numpy as np

from firmware_bridge.kinematics import Geometry, WheelGeometry
from firmware_bridge.messages import ConfigError
from kmpc_lab.emulator.board import COAST, STEP, STILL, Body
from kmpc_lab.emulator.rover.physics import Demand, DriveLimits, RoverPhysics
from kmpc_lab.sim.twin import Twin

CORRECTION = (1.0, 2.0)
"""Integral gains with which an autopilot brings measured speed and turn rate to what it wants
[1/s]."""
LARGEST_CORRECTION = (0.3, 2.0)  # [m/s, rad/s]


class TwinBody(Body):
    """A `Body` whose motors turn the twin's wheels: both of a skid-steered side follow a channel.

    `geometry`: of the robot file; of it the channels' order, signs and gears count here. `twin`:
    the robot. `now`: time of the clock at the start [s]. Raises ConfigError for a board that drives
    other wheels.
    """

    def __init__(self, geometry: Geometry, twin: Twin, now: float) -> None:
        super().__init__(geometry, slip=0.0, turn_gain=1.0, seed=0, lag=0.0, now=now)
        if not isinstance(geometry, WheelGeometry):
            raise ConfigError(
                "physics: expected a board for a left and a right side, which the digital twin "
                f"has, got one for {', '.join(geometry.names)}"
            )
        self.twin = twin
        self._angles = twin.wheel_angles

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m] and theta [rad], not wrapped."""
        return self.twin.pose

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down somewhere."""
        self.twin.place(x, y, theta)
        self._angles = self.twin.wheel_angles

    def _step(self) -> None:
        targets = []
        for i in range(len(self.command)):
            change = min(max(self.command[i], -self._top), self._top) - self._ramped[i]
            self._ramped[i] += math.copysign(min(abs(change), self.ramp * STEP), change)
            targets.append(
                self._ramped[i] if self.driven[i] else self.speeds[i] * math.exp(-STEP / COAST)
            )
        self.twin.turn_wheels(*self._geometry.from_channels(*targets))
        self.twin.advance(STEP)
        angles, speeds = self.twin.wheel_angles, self.twin.wheel_speeds
        turned, self._angles = angles - self._angles, angles
        for i, turns in enumerate(self._geometry.to_channels(*turned.tolist())):
            self.turns[i] += turns
        self.speeds = list(self._geometry.to_channels(*speeds.tolist()))
        if (
            not any(targets)
            and np.abs(speeds).max() < STILL
            and max(map(abs, self.twin.velocity)) < STILL
        ):
            self.speeds = [0.0] * len(self.speeds)


class TwinRover(RoverPhysics):
    """The twin as the rover of the emulated autopilot, whose loops correct what its wheels slip."""

    def __init__(self, twin: Twin) -> None:
        super().__init__()
        self.twin = twin
        self._corrections = np.zeros(2)

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y [m], theta [rad]."""
        return self.twin.pose

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the rover somewhere, standing."""
        super().place(x, y, theta)
        self.twin.place(x, y, theta)
        self._corrections[:] = 0.0

    def step(self, demand: Demand, limits: DriveLimits, dt: float) -> None:
        """Move for dt [s]."""
        wanted = np.array(self.loops(demand, limits, dt)) / dt
        theta = self.twin.pose[2]
        east, north, turn = self.twin.velocity
        measured = np.array((east * math.cos(theta) + north * math.sin(theta), turn))
        if demand.speed is None and not demand.turn:
            self._corrections[:] = 0.0
        else:
            self._corrections += dt * np.array(CORRECTION) * (wanted - measured)
            self._corrections = np.clip(
                self._corrections, np.negative(LARGEST_CORRECTION), LARGEST_CORRECTION
            )
        v, omega = wanted + self._corrections
        self.twin.command(float(v), float(omega))
        self.twin.advance(dt)
        self.velocity = self.twin.velocity
