"""How the emulated rover moves.

The lags of a real ArduPilot rover act before the wheels, `kmpc_lite`'s robot moves on the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.sim import DifferentialDrive

NATURAL_FREQUENCY, DAMPING = 5.794, 0.5659
"""Speed loop behind a ramp of 1 m/s^2: 0.5 m/s from standstill reaches 90 % in 0.69 s and peaks at
0.541 m/s, as measured [rad/s, 1]."""
BRAKE = 0.625
"""Deceleration of a stop: 0.2 m from 0.5 m/s, as measured [m/s^2]."""
TURN_LAG = 0.0605
"""Yaw-rate loop: with 120 deg/s^2 a turn of 0.3 rad/s reaches 90 % in 0.17 s, as measured [s]."""
SUBSTEP = 0.002
"""Of the lags [s]."""
STILL = 1e-3
"""Slower than this stands [m/s, rad/s]."""


@dataclass(frozen=True)
class Demand:
    """What the autopilot asks of its loops."""

    speed: float | None = None
    """[m/s]; None brakes."""
    turn: float = 0.0
    """Counter-clockwise [rad/s]."""


@dataclass(frozen=True)
class DriveLimits:
    """What the loops may do."""

    acceleration: float
    """[m/s^2]"""
    turn_acceleration: float
    """[rad/s^2]"""
    turn: float
    """[rad/s]"""


class RoverPhysics:
    """Pose and velocity of the rover, ENU.

    Parameters
    ----------
    slip, turn_gain, seed
        Of `kmpc_lite.sim.DifferentialDrive`.
    """

    def __init__(self, slip: float = 0.0, turn_gain: float = 1.0, seed: int = 0) -> None:
        self._floor = DifferentialDrive(slip=slip, seed=seed, turn_gain=turn_gain)
        self._pose = np.zeros(3)
        self._ramp = self._speed = self._acceleration = self._turn = 0.0
        self.velocity = (0.0, 0.0, 0.0)
        """True velocity: east, north [m/s], turn rate counter-clockwise [rad/s]."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y [m], theta [rad]."""
        return float(self._pose[0]), float(self._pose[1]), float(self._pose[2])

    @property
    def stopped(self) -> bool:
        """Whether the rover stands."""
        return all(abs(component) < STILL for component in self.velocity)

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the rover somewhere, standing."""
        self._pose = np.array((x, y, theta), dtype=float)
        self._ramp = self._speed = self._acceleration = self._turn = 0.0
        self.velocity = (0.0, 0.0, 0.0)

    def step(self, demand: Demand, limits: DriveLimits, dt: float) -> None:
        """Move for dt [s]."""
        distance, angle = self.loops(demand, limits, dt)
        before = self._pose
        self._pose = self._floor.step(before, (distance / dt, angle / dt), dt)
        east, north, turn = (self._pose - before) / dt
        self.velocity = (float(east), float(north), float(turn))

    def loops(self, demand: Demand, limits: DriveLimits, dt: float) -> tuple[float, float]:
        """Way [m] and turn [rad] that the speed and yaw-rate loops ask of the wheels in dt [s]."""
        count = max(1, round(dt / SUBSTEP))
        h, distance, angle = dt / count, 0.0, 0.0
        for _ in range(count):
            self._speed_loop(demand.speed, limits.acceleration, h)
            self._turn_loop(demand.turn, limits, h)
            distance += self._speed * h
            angle += self._turn * h
        return distance, angle

    def _speed_loop(self, wanted: float | None, limit: float, h: float) -> None:
        if wanted is None:
            self._speed -= _within(self._speed, BRAKE * h)
            self._ramp, self._acceleration = self._speed, 0.0
            return
        self._ramp += _within(wanted - self._ramp, limit * h)
        self._acceleration += (
            h
            * NATURAL_FREQUENCY
            * (NATURAL_FREQUENCY * (self._ramp - self._speed) - 2.0 * DAMPING * self._acceleration)
        )
        self._speed += h * self._acceleration

    def _turn_loop(self, wanted: float, limits: DriveLimits, h: float) -> None:
        error = _within(wanted, limits.turn) - self._turn
        self._turn += h * _within(error / TURN_LAG, limits.turn_acceleration)


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
