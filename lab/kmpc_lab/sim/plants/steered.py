"""Cars and omnis: a bicycle whose servo takes time, mecanum wheels that slip sideways.

Or either of them with motors and servos that follow late: commands pass a dead time, a limited rate
and a lag; the wheels' gains, slip and cross-talk follow. They share no code with what is learned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.wheels import Car
from kmpc_lite.geometry import exact_arc
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

FINEST = 0.02  # longest step in which a servo's curvature is held [s]
CREEPS = 1e-6  # speed below which a command says nothing of how the wheels are steered [m/s]
SIDEWAYS = 2.0  # how many times as much as wheels the rollers of mecanum wheels slip
STANDS = 1e-9  # speed that stands for none [m/s]


class SteeredDrive:
    """A car that slips: its wheels stay steered as they are while it stands.

    ``omega = v kappa / (1 + K v^2)``; the curvature kappa follows ``omega / v`` of the command as
    fast as the servo turns.

    `car`: turning radius and steering rate. `slip`: mean of the exponential slip ratios of speed,
    sideways and of turns, drawn every period. `understeer`: k [s^2/m^2]. `offset`: curvature in
    which it drives when it is commanded to drive straight [1/m]. `backward_gain`: share of a
    commanded speed that happens backwards. `seed`: of the slip.

    Examples
    --------
    >>> SteeredDrive(Car(0.5)).trace([0.0, 0.0, 0.0], [1.0, 9.0], 0.1, 1).round(3) + 0.0
    array([[0.099, 0.01 , 0.2  ]])
    """

    def __init__(
        self,
        car: Car,
        slip: float = 0.0,
        understeer: float = 0.0,
        offset: float = 0.0,
        backward_gain: float = 1.0,
        seed: int = 0,
    ) -> None:
        self._car, self._slip, self._understeer = car, slip, understeer
        self._offset, self._backward_gain = offset, backward_gain
        self._random = np.random.default_rng(seed)
        self.reset()

    def reset(self) -> None:
        """Steer straight; the slip goes on at random."""
        self._curvature = 0.0

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states (substeps, 3) during one period, without the first."""
        state, (speed, turn_rate) = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        wanted = self._curvature if abs(speed) < CREEPS else turn_rate / speed
        wanted = float(np.clip(wanted, -self._car.curvature, self._car.curvature))
        rate = np.inf if self._car.steering_rate is None else self._car.steering_rate
        slips = self._random.exponential(1.0, 3) * self._slip
        v = speed * (self._backward_gain if speed < 0.0 else 1.0)
        path = np.empty((substeps, 3))
        parts = max(int(np.ceil(dt / substeps / FINEST)), 1)
        h = dt / substeps / parts
        for i in range(substeps):
            for _ in range(parts):
                self._curvature += float(np.clip(wanted - self._curvature, -rate * h, rate * h))
                omega = v * (self._curvature + self._offset) / (1.0 + self._understeer * v * v)
                moved = (1.0 + slips[0]) * v, (1.0 + slips[2]) * omega
                state = exact_arc(state, *moved, h, -slips[1] * v)
            path[i] = state
        return path


class MecanumDrive:
    """An omni whose rollers slip, sideways the most.

    `slip`: mean of the exponential slip ratios, drawn every period: of what is commanded ahead and
    round; twice that sideways. `seed`: of the slip.

    Examples
    --------
    >>> MecanumDrive().trace([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.1, 1).round(3)
    array([[0. , 0.1, 0. ]])
    """

    def __init__(self, slip: float = 0.0, seed: int = 0) -> None:
        self._slip, self._random = slip, np.random.default_rng(seed)

    def reset(self) -> None:
        """Nothing to forget."""

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states (substeps, 3) during one period, without the first."""
        slips = self._random.exponential(1.0, 3) * self._slip * (1.0, SIDEWAYS, 1.0)
        ahead, left, omega = np.asarray(u, dtype=float) * np.maximum(1.0 - slips, 0.0)
        times = dt / substeps * np.arange(1, substeps + 1)
        return exact_arc(np.asarray(x, dtype=float), ahead, omega, times, left)


@dataclass(frozen=True)
class Follower:
    """How motors, or motors and a servo, follow what they are asked for, number by number."""

    dead_time: float  # until anything happens [s]
    rates: tuple[float, ...]  # fastest change of each number [1/s]; infinite for none
    lags: tuple[float, ...]  # time constant of each number [s]; 0 for none


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

    wheelbase: float  # distance between the axles [m]; its pose is at the middle of the rear one
    lock: float  # largest steering angle [rad]
    follower: Follower  # of speed and steering angle
    gains: tuple[float, float] = (1.0, 1.0)
    """Shares of a commanded speed that happen ahead, and backwards."""
    understeer: float = 0.0  # K of ``omega = v tan(angle) / (wheelbase (1 + K v^2))`` [s^2/m^2]
    offset: float = 0.0
    """Steering angle in which it drives when it is asked to drive straight [rad]."""
    slip: float = 0.0  # mean of the exponential slip ratios, drawn anew each period


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

    follower: Follower  # of v_x, v_y and omega
    gains: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    """Shares of what is commanded that happen ahead, backwards, sideways and round."""
    crosstalk: float = 0.0  # how far it turns for each metre that it drives sideways [rad/m]
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
