"""How the emulated rover moves.

The lags of a real ArduPilot rover act before the wheels, `kmpc_lite`'s robot moves on the floor.
One that steers does so after its turn rate, as Rover 4.6.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lab.sim.plants.robots import DifferentialDrive

SPEED_FREQUENCY, SPEED_DAMPING = 14.8, 1.5
"""Speed loop behind the ramp of ATC_ACCEL_MAX [rad/s, 1], fitted to steps of 0.5 m/s of Rover 4.6.3
with 1 m/s^2: 0.15, 0.47, 0.84 and 1.07 of the step after 0.2, 0.4, 0.6 and 1.0 s."""
OVERSHOOT, OVERSHOOT_TIME = 0.1, 2.0
"""Share of a new speed by which it is overdone at first, and the time constant of its fading [s]:
1.09 of the step after 1.2 s, 1.04 after 2.5 s, as recorded."""
TURN_FREQUENCY, TURN_DAMPING = 31.0, 0.3
"""Yaw-rate loop behind the ramp of ATC_STR_ACC_MAX [rad/s, 1], fitted to steps of 0.6 rad/s with
120 deg/s^2: 0.26, 0.66, 0.98 and 1.02 of the step after 0.1, 0.2, 0.3 and 0.4 s."""
SUBSTEP = 0.002  # of the lags [s]
STILL = 1e-3  # slower than this stands [m/s, rad/s]
LOCK = math.radians(35.0)  # steering angle at which it drives its tightest circle: SITL's own rover
SLOWEST = 0.1
"""From this speed on it steers in inverse proportion to its speed, if it is tuned [m/s]."""


@dataclass(frozen=True)
class Demand:
    """What the autopilot asks of its loops."""

    speed: float | None = None  # [m/s]; None brakes
    turn: float = 0.0  # counter-clockwise [rad/s]


@dataclass(frozen=True)
class DriveLimits:
    """What the loops may do."""

    acceleration: float  # [m/s^2]
    deceleration: float  # [m/s^2]
    turn_acceleration: float  # [rad/s^2]
    turn: float  # [rad/s]
    steering: tuple[float, float, float] = (1.0, 0.2, 0.2)
    """Of steered wheels: MOT_SPD_SCA_BASE [m/s], ATC_STR_RAT_FF and ATC_STR_RAT_P."""


class RoverPhysics:
    """Pose and velocity of the rover, ENU.

    `slip`, `turn_gain`, `seed`: of `kmpc_lab.sim.plants.robots.DifferentialDrive`.
    """

    def __init__(self, slip: float = 0.0, turn_gain: float = 1.0, seed: int = 0) -> None:
        self._floor = DifferentialDrive(slip=slip, seed=seed, turn_gain=turn_gain)
        self._pose = np.zeros(3)
        self._ramp = self._slow = self._speed = self._acceleration = 0.0
        self._turn_ramp = self._turn = self._jerk = 0.0
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
        self._ramp = self._slow = self._speed = self._acceleration = 0.0
        self._turn_ramp = self._turn = self._jerk = 0.0
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
            self._speed_loop(demand.speed, limits, h)
            self._turn_loop(demand.turn, limits, h)
            distance += self._speed * h
            angle += self._turn * h
        return distance, angle

    def _speed_loop(self, wanted: float | None, limits: DriveLimits, h: float) -> None:
        target = 0.0 if wanted is None else wanted
        braking = target * self._ramp < 0.0 or abs(target) < abs(self._ramp)
        limit = limits.deceleration if braking else limits.acceleration
        self._ramp += within(target - self._ramp, limit * h)
        self._slow += h * (self._ramp - self._slow) / OVERSHOOT_TIME
        asked = self._ramp + OVERSHOOT * (self._ramp - self._slow)
        if wanted is None and asked * self._ramp <= 0.0:
            asked = self._slow = 0.0  # a brake does not reverse
        before = self._speed
        pull = SPEED_FREQUENCY * (asked - self._speed) - 2.0 * SPEED_DAMPING * self._acceleration
        self._acceleration += h * SPEED_FREQUENCY * pull
        self._speed += h * self._acceleration
        if wanted is None and self._speed * before < 0.0:
            self._speed = self._acceleration = 0.0

    def _turn_loop(self, wanted: float, limits: DriveLimits, h: float) -> None:
        target = within(wanted, limits.turn)
        self._turn_ramp += within(target - self._turn_ramp, limits.turn_acceleration * h)
        pull = TURN_FREQUENCY * (self._turn_ramp - self._turn) - 2.0 * TURN_DAMPING * self._jerk
        self._jerk += h * TURN_FREQUENCY * pull
        self._turn += h * self._jerk


def within(value: float, limit: float) -> float:
    """Clip to [-limit, limit]."""
    return min(max(value, -limit), limit)


def tuned(turning_radius: float) -> dict[str, float]:
    """Parameters with which turn rates are what was asked, as docs/howto/boards.md says."""
    ahead = turning_radius / SLOWEST
    return {"MOT_SPD_SCA_BASE": SLOWEST, "ATC_STR_RAT_FF": ahead, "ATC_STR_RAT_P": 0.2 * ahead}


class SteeredRover(RoverPhysics):
    """A rover that turns only while it drives.

    The firmware steers in proportion to the turn rate that is asked for, whatever the speed; above
    MOT_SPD_SCA_BASE in inverse proportion to the speed, so that the turn rate is what was asked.

    `turning_radius`: of its tightest circle [m]; SITL's rover has 0.9. `slip`, `turn_gain`, `seed`:
    of `kmpc_lab.sim.plants.robots.DifferentialDrive`.
    """

    def __init__(
        self, turning_radius: float, slip: float = 0.0, turn_gain: float = 1.0, seed: int = 0
    ) -> None:
        super().__init__(slip, turn_gain, seed)
        self._radius = turning_radius

    def _turn_loop(self, wanted: float, limits: DriveLimits, h: float) -> None:
        """Steer as AR_AttitudeControl::get_steering_out_rate and AP_MotorsUGV do."""
        target = within(wanted, limits.turn)
        self._turn_ramp += within(target - self._turn_ramp, limits.turn_acceleration * h)
        slowest, ahead, behind = limits.steering
        steering = ahead * self._turn_ramp + behind * (self._turn_ramp - self._turn)
        if abs(self._speed) > slowest > 0.0:
            steering *= slowest / abs(self._speed)
        if self._speed < 0.0:
            steering = -steering
        bend = math.sin(LOCK * within(steering, 1.0)) / math.sin(LOCK) / self._radius
        self._turn = self._speed * bend
