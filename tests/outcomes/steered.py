"""Cars and omnis as they are: they share no code with the controller's prediction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from outcomes.plant import LOOKS, Array


@dataclass(frozen=True)
class Steering:
    """What a car's motor and steering are like."""

    sharpest: float  # largest curvature [1/m]
    rate: float = math.inf  # fastest change of the curvature [1/m per second]
    lag: float = 0.0  # time constant of the motor [s]
    gains: tuple[float, float] = (1.0, 1.0)
    """Shares of the commanded speed that happen ahead, and backwards."""
    understeer: float = 0.0  # K of ``omega = v kappa / (1 + K v^2)`` [s^2/m^2]
    offset: float = 0.0  # curvature in which it drives when it is told to drive straight [1/m]
    slip: float = 0.0  # mean of the exponential slip ratios, drawn anew each period


class Bicycle:
    """Drives a car by short arcs: its wheels stay steered as they are while it stands."""

    def __init__(self, steering: Steering, dt: float, seed: int | Sequence[int]) -> None:
        self._car, self._h = steering, dt / LOOKS
        self._random = np.random.default_rng(seed)
        self._speed = self._curvature = 0.0

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        car, h = self._car, self._h
        asked, turn_rate = command.tolist()
        wanted = self._curvature if abs(asked) < 1e-6 else turn_rate / asked
        wanted = min(max(wanted, -car.sharpest), car.sharpest)
        share = 1.0 - math.exp(-h / car.lag) if car.lag else 1.0
        slip, aside, turned = self._random.exponential(1.0, 3) * car.slip
        poses = np.empty((LOOKS, 3))
        for i in range(LOOKS):
            most = car.rate * h
            self._curvature += min(max(wanted - self._curvature, -most), most)
            self._speed += share * (asked * car.gains[asked < 0.0] - self._speed)
            v = self._speed * (1.0 + slip)
            omega = self._speed * (self._curvature + car.offset) * (1.0 + turned)
            omega /= 1.0 + car.understeer * v * v
            pose = poses[i] = _moved(pose, v, -aside * self._speed, omega, h)
        return poses


@dataclass(frozen=True)
class Rollers:
    """What mecanum wheels are like."""

    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)  # shares of v_x, v_y and omega that happen
    lag: float = 0.0  # time constant of the motors [s]
    slip: float = 0.0
    """Mean of the exponential slip ratios: of what is driven ahead, aside, and turned."""


class Mecanum:
    """Drives an omni by short arcs."""

    def __init__(self, rollers: Rollers, dt: float, seed: int | Sequence[int]) -> None:
        self._wheels, self._h = rollers, dt / LOOKS
        self._random = np.random.default_rng(seed)
        self._speeds = np.zeros(3)

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        wheels, h = self._wheels, self._h
        share = 1.0 - math.exp(-h / wheels.lag) if wheels.lag else 1.0
        ratios = 1.0 - np.minimum(self._random.exponential(1.0, 3) * wheels.slip, 1.0)
        poses = np.empty((LOOKS, 3))
        for i in range(LOOKS):
            self._speeds = self._speeds + share * (command * wheels.gains - self._speeds)
            ahead, left, omega = (self._speeds * ratios).tolist()
            pose = poses[i] = _moved(pose, ahead, left, omega, h)
        return poses


def _moved(pose: Array, ahead: float, left: float, omega: float, h: float) -> Array:
    """Pose (3,) after a time [s] at these speeds."""
    middle = pose[2] + 0.5 * omega * h
    cos, sin = math.cos(middle), math.sin(middle)
    x, y = pose[0] + (ahead * cos - left * sin) * h, pose[1] + (ahead * sin + left * cos) * h
    return np.array([x, y, pose[2] + omega * h])
