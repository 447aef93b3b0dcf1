"""The digital twin's car and its ROSbot on mecanum wheels as robots of the study ``anyrobot``.

A seed is one robot, with its own weight distribution and tyres; it is learned from its own log and
driven over a map of its size, as those that are drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from firmware_bridge.messages import speeds_of
from kmpc_lab.sim.plants.steered import Chassis, Follower, Rollers
from kmpc_lab.sim.twin.plant import Twin
from kmpc_lab.sim.twin.vehicles import CAR_LOCK, VEHICLES
from kmpc_lab.studies.any_wheels import CarRobot, Moves, OmniRobot
from kmpc_lite.control import Footprint
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

NOISE = (0.005, 0.01)
"""Of a measured pose [m, rad]."""


class TwinMoves:
    """A robot of the twin, driven period by period."""

    def __init__(self, wheels: str, dt: float, number: int) -> None:
        self._twin, self._dt = Twin(seed=number, wheels=wheels), dt
        self._last = np.zeros(3)

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) in a period; a car's command is a speed and a steering angle."""
        twin, poses = self._twin, np.empty((LOOKS, 3))
        if (pose != self._last).any():
            twin.place(*pose.tolist())
        if twin.vehicle.car:
            speed, angle = command.tolist()
            twin.turn_wheels(speed / twin.vehicle.radius)
            twin.steer(angle)
        else:
            twin.command(*speeds_of(command))
        for k in range(LOOKS):
            twin.advance(self._dt / LOOKS)
            poses[k] = twin.pose
        self._last = poses[-1]
        return poses


@dataclass(frozen=True)
class TwinCar(CarRobot):
    """The twin's car."""

    number: int = 0
    """Which of its kind."""

    def moves(self, seed: int) -> Moves:
        """The same robot in its log and in its drive; nothing about it is random."""
        return TwinMoves("car", self.dt, self.number)


@dataclass(frozen=True)
class TwinOmni(OmniRobot):
    """The twin's ROSbot on mecanum wheels."""

    number: int = 0
    """Which of its kind."""

    def moves(self, seed: int) -> Moves:
        """The same robot in its log and in its drive; nothing about it is random."""
        return TwinMoves("omni", self.dt, self.number)


def twin_car(number: int) -> TwinCar:
    """Give a car of the twin; its log tells steering angles."""
    vehicle, length, width = VEHICLES["car"], 0.58, 0.31
    assert vehicle.car is not None
    servo = Follower(0.0, (math.inf, vehicle.servo_rate), (0.0, 0.0))
    wheelbase = vehicle.car.wheelbase
    return TwinCar(
        "car in MuJoCo",
        Chassis(wheelbase, CAR_LOCK, servo),
        Footprint.rectangle(length, width, -0.5 * wheelbase),
        0.5 * math.hypot(length, width),
        speed=1.5,
        dt=0.1,
        noise=NOISE,
        column="steering_angle",
        number=number,
    )


def twin_omni(number: int) -> TwinOmni:
    """Give a ROSbot on mecanum wheels of the twin."""
    length, width = 0.2, 0.25
    return TwinOmni(
        "mecanum in MuJoCo",
        Rollers(Follower(0.0, (math.inf,) * 3, (0.0,) * 3)),
        Footprint.rectangle(length, width),
        0.5 * math.hypot(length, width),
        speeds=(0.6, 0.4, 1.5),
        dt=0.1,
        noise=NOISE,
        number=number,
    )
