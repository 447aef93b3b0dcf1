"""Cars drawn at random, and how they really move: this shares no code with the controller."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.control import Footprint, NavigationProblem
from kmpc_lite.control.wheels import Car
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

DT = 0.1
"""Control period [s]."""


@dataclass(frozen=True)
class DrawnCar:
    """A car; its pose is at the middle of the rear axle."""

    length: float
    """[m]"""
    width: float
    """[m]"""
    overhang: float
    """How far it reaches behind the rear axle [m]."""
    radius: float
    """Of the tightest circle of the rear axle [m]."""
    speed: float
    """Largest speed in either gear [m/s]."""
    steering_rate: float | None
    """Fastest change of the curvature [1/m per second]; at once if not given."""
    slip: float
    """Mean of the exponential slip ratios, drawn anew each period."""
    reverse: bool = True
    """Whether it may drive backwards."""

    @property
    def front(self) -> float:
        """How far it reaches ahead of the rear axle [m]."""
        return self.length - self.overhang

    @property
    def footprint(self) -> Footprint:
        """What it covers."""
        return Footprint.rectangle(self.length, self.width, ahead=self.overhang - 0.5 * self.length)

    def problem(self) -> NavigationProblem:
        """Its navigation problem, in an open area."""
        turn_rate = self.speed / self.radius
        return NavigationProblem(
            dt=DT,
            u_min=(-self.speed if self.reverse else 0.0, -turn_rate),
            u_max=(self.speed, turn_rate),
            footprint=self.footprint,
            wheels=Car(self.radius, self.steering_rate),
        )


def random_car(seed: int) -> DrawnCar:
    """Draw a car, from a model of a foot to a lorry of 6 m.

    Turning radii are those of real cars, 0.75 to 1.1 times their length.
    """
    random = np.random.default_rng([seed, 21])
    length = float(np.exp(random.uniform(np.log(0.3), np.log(6.0))))
    radius = length * float(random.uniform(0.75, 1.1))
    lock = float(random.uniform(0.5, 1.5))
    steers_at_once = random.random() < 0.3
    return DrawnCar(
        length,
        length * float(random.uniform(0.4, 0.55)),
        length * float(random.uniform(0.12, 0.25)),
        radius,
        length * float(random.uniform(0.4, 1.2)),
        None if steers_at_once else 2.0 / (radius * lock),
        float(random.uniform(0.0, 0.03)),
    )


class Bicycle:
    """Drives a car by short steps; its wheels stay steered as they are while it stands."""

    def __init__(self, car: DrawnCar, seed: int) -> None:
        self._car, self._random = car, np.random.default_rng([seed, 23])
        self._curvature = 0.0

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        car, h, poses = self._car, DT / LOOKS, np.empty((LOOKS, 3))
        speed, turn_rate = command.tolist()
        sharpest = 1.0 / car.radius
        wanted = turn_rate / speed if abs(speed) > 1e-9 else self._curvature
        wanted = min(max(wanted, -sharpest), sharpest)
        most = math.inf if car.steering_rate is None else car.steering_rate * h
        ahead, aside, turned = car.slip * self._random.exponential(1.0, 3)
        x, y, heading = pose.tolist()
        for k in range(LOOKS):
            self._curvature += min(max(wanted - self._curvature, -most), most)
            driven, left = speed * (1.0 - ahead) * h, speed * aside * h
            turn = driven * self._curvature * (1.0 - turned)
            middle = heading + 0.5 * turn
            x += driven * math.cos(middle) - left * math.sin(middle)
            y += driven * math.sin(middle) + left * math.cos(middle)
            heading += turn
            poses[k] = x, y, heading
        return poses
