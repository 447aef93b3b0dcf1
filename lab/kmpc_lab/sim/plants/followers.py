"""Cars and omnis whose motors and servos follow late: they share no code with what is learned.

Commands pass a dead time, a limited rate and a lag; the wheels' gains, slip and cross-talk follow.
Speeds are held between two looks, as by `studies.any_robot.RobotPlant`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

STANDS = 1e-9
"""Speed that stands for none [m/s]."""


@dataclass(frozen=True)
class Follower:
    """How motors, or motors and a servo, follow what they are asked for, number by number."""

    dead_time: float
    """Until anything happens [s]."""
    rates: tuple[float, ...]
    """Fastest change of each number [1/s]; infinite for none."""
    lags: tuple[float, ...]
    """Time constant of each number [s]; 0 for none."""


class Follows:
    """Values that follow what is asked, look by look."""

    def __init__(self, follower: Follower, dt: float) -> None:
        h, lags = dt / LOOKS, np.array(follower.lags)
        self._most = np.array(follower.rates) * h
        with np.errstate(divide="ignore"):
            self._share = np.where(lags > 0.0, 1.0 - np.exp(-h / lags), 1.0)
        none = np.zeros(len(lags))
        self._waiting = [none] * round(follower.dead_time / h)
        self._let_through = self._values = none

    def __call__(self, asked: Array) -> Array:
        """Values (k,) one look after these (k,) were asked for."""
        self._waiting.append(asked)
        change = self._waiting.pop(0) - self._let_through
        self._let_through = self._let_through + np.clip(change, -self._most, self._most)
        self._values = self._values + self._share * (self._let_through - self._values)
        return self._values


@dataclass(frozen=True)
class Chassis:
    """What a car is like."""

    wheelbase: float
    """Distance between the axles [m]; its pose is at the middle of the rear one."""
    lock: float
    """Largest steering angle [rad]."""
    follower: Follower
    """Of speed and steering angle."""
    gains: tuple[float, float] = (1.0, 1.0)
    """Shares of a commanded speed that happen ahead, and backwards."""
    understeer: float = 0.0
    """K of ``omega = v tan(angle) / (wheelbase (1 + K v^2))`` [s^2/m^2]."""
    offset: float = 0.0
    """Steering angle in which it drives when it is asked to drive straight [rad]."""
    slip: float = 0.0
    """Mean of the exponential slip ratios, drawn anew each period."""


class CarPlant:
    """A car; its wheels stay steered as they are while it stands."""

    def __init__(self, chassis: Chassis, dt: float, seed: int) -> None:
        self._car, self._h = chassis, dt / LOOKS
        self._follows = Follows(chassis.follower, dt)
        self._random = np.random.default_rng([seed, 17])

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) in one period of a commanded speed and steering angle (2,)."""
        car, poses = self._car, np.empty((LOOKS, 3))
        asked = np.array((command[0], np.clip(command[1], -car.lock, car.lock)))
        longer, aside, rounder = self._random.exponential(car.slip, 3) if car.slip else (0.0,) * 3
        for k in range(LOOKS):
            speed, angle = self._follows(asked).tolist()
            v = speed * car.gains[speed < 0.0]
            bend = math.tan(angle + car.offset) / car.wheelbase / (1.0 + car.understeer * v * v)
            moved = v * (1.0 + longer), -v * aside * np.sign(bend), v * bend * (1.0 + rounder)
            pose = poses[k] = _moved(pose, *moved, self._h)
        return poses


@dataclass(frozen=True)
class Rollers:
    """What an omni is like."""

    follower: Follower
    """Of v_x, v_y and omega."""
    gains: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    """Shares of what is commanded that happen ahead, backwards, sideways and round."""
    crosstalk: float = 0.0
    """How far it turns for each metre that it drives sideways [rad/m]."""
    slip: float = 0.0
    """Mean of the exponential slip ratios, drawn anew each period: twice as much sideways."""


class OmniPlant:
    """A robot on mecanum or omni wheels."""

    def __init__(self, rollers: Rollers, dt: float, seed: int) -> None:
        self._wheels, self._h = rollers, dt / LOOKS
        self._follows = Follows(rollers.follower, dt)
        self._random = np.random.default_rng([seed, 19])

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) in one period of a command (3,)."""
        wheels, poses = self._wheels, np.empty((LOOKS, 3))
        ahead, back, side, turn = wheels.gains
        slips = self._random.exponential(wheels.slip, 3) if wheels.slip else np.zeros(3)
        kept = np.maximum(1.0 - slips * (1.0, 2.0, 1.0), 0.0)
        for k in range(LOOKS):
            x, y, omega = (self._follows(command) * kept).tolist()
            x, y = x * (ahead if x > 0.0 else back), y * side
            pose = poses[k] = _moved(pose, x, y, omega * turn + wheels.crosstalk * y, self._h)
        return poses


def _moved(pose: Array, ahead: float, left: float, omega: float, h: float) -> Array:
    """Pose (3,) after a time [s] at these speeds."""
    middle = pose[2] + 0.5 * omega * h
    cos, sin = math.cos(middle), math.sin(middle)
    x, y = pose[0] + (ahead * cos - left * sin) * h, pose[1] + (ahead * sin + left * cos) * h
    return np.array((x, y, pose[2] + omega * h))
