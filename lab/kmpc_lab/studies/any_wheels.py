"""Cars and omnis of the study ``anyrobot``: drawn from a seed, and learned from their own logs.

A log is a table as a user has it: of a car with steering angles, curvatures or a servo's position,
of an omni with a speed sideways. `load_logs` recognises the kind, and `learn` learns it, as
``kmpc fit`` does. A car is driven by the turning radius and the steering that were found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, Protocol

import numpy as np

from kmpc_lab.sim.plants.steered import STANDS, CarPlant, Chassis, Follower, OmniPlant, Rollers
from kmpc_lite.control import Footprint, NavigationProblem
from kmpc_lite.control.path.motions import curves, seen_from
from kmpc_lite.control.wheels import Car, Omni
from kmpc_lite.learn.learning import learn
from kmpc_lite.learn.loading import load_logs, read_checked
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

SECONDS = 90.0  # how long a log is [s]
HELD = {"car": 1.0, "omni": 0.5}  # how long a command of it is held [s]
STEERING = ("steering_angle", "curvature", "servo")
"""Columns by one of which a car's log tells how it is steered."""


class Moves(Protocol):
    """A robot as it is."""

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (n, 3) during one period from a pose (3,)."""


class Ready(NamedTuple):
    """A robot that was learned."""

    model: KoopmanModel
    problem: NavigationProblem  # its area aside
    plant: Moves


@dataclass(frozen=True)
class CarRobot:
    """A car as it is drawn."""

    name: str
    chassis: Chassis
    footprint: Footprint
    radius: float  # of the circle about the outline's middle, which is the size of its map [m]
    speed: float  # largest speed [m/s]
    dt: float  # control period [s]
    noise: tuple[float, float]  # standard deviation of a measured pose [m, rad]
    column: str  # by which of `STEERING` its log tells how it is steered

    def ideal(self, start: Array, goal: Array) -> float:
        """Time of the shortest curve of Reeds and Shepp at full speed [s]."""
        radius = self.chassis.wheelbase / math.tan(self.chassis.lock)
        seen = seen_from(start, goal[None]) / (radius, radius, 1.0)
        return radius * float(np.abs(curves(seen)).sum(axis=-1).min()) / self.speed

    def ready(self, seed: int) -> Ready:
        """Record its log, learn it, and say how it is driven."""
        random = np.random.default_rng([seed, 23])
        commands = held(random, (self.speed, self.chassis.lock), self.dt, HELD["car"])
        told = self._told(commands[:, 1])
        told, names = np.column_stack([commands[:, 0], told]), ("v", self.column)
        with TemporaryDirectory() as folder:
            log = Path(folder) / "car.csv"
            record(log, self, self.moves(seed + 1), commands, random, told, names)
            model = learn(load_logs([log], self.dt), [log]).model
            found, _ = read_checked(log, ReadOptions(), self.dt)
        speeds, rates = found.commands.values.T
        rows = np.rint(found.commands.time / self.dt).astype(int)
        order = np.argsort(rates / speeds)
        bends, angles = (rates / speeds)[order], commands[np.minimum(rows, len(commands) - 1), 1]
        sharpest = float(np.abs(bends).max())
        # lock to lock
        lasts = 2.0 * self.chassis.lock / self.chassis.follower.rates[1]
        problem = NavigationProblem(
            dt=self.dt,
            u_min=(-self.speed, -self.speed * sharpest),
            u_max=(self.speed, self.speed * sharpest),
            footprint=self.footprint,
            wheels=Car(1.0 / sharpest, 2.0 * sharpest / lasts),
        )
        return Ready(model, problem, Steered(self.moves(seed), bends, angles[order]))

    def moves(self, seed: int) -> Moves:
        """What is asked for speeds and steering angles; a seed of its slip."""
        return CarPlant(self.chassis, self.dt, seed)

    def _told(self, angles: Array) -> Array:
        """What its log says of steering angles (n,)."""
        if self.column == "curvature":
            out: Array = np.tan(angles) / self.chassis.wheelbase
            return out
        return angles if self.column == "steering_angle" else 0.5 + 0.6 * angles


class Steered:
    """A car that is asked for a speed and a turn rate: a link that knows what `fit` has found."""

    def __init__(self, plant: Moves, bends: Array, angles: Array) -> None:
        self._plant, self._bends, self._angles = plant, bends, angles
        self._angle = 0.0

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (n, 3) during one period; wheels of a car that stands stay as they are."""
        v, omega = command.tolist()
        if abs(v) > STANDS:
            self._angle = float(np.interp(omega / v, self._bends, self._angles))
        return self._plant.drive(pose, np.array((v, self._angle)))


@dataclass(frozen=True)
class OmniRobot:
    """An omni as it is drawn."""

    name: str
    rollers: Rollers
    footprint: Footprint | None
    radius: float  # of what it covers [m]
    speeds: tuple[float, float, float]  # largest v_x, v_y [m/s] and omega [rad/s]
    dt: float  # control period [s]
    noise: tuple[float, float]  # standard deviation of a measured pose [m, rad]

    def ideal(self, start: Array, goal: Array) -> float:
        """Straight line at full speed ahead, or the turn where that takes longer [s]."""
        driven = float(np.hypot(*(goal - start)[:2])) / self.speeds[0]
        return max(driven, abs(math.remainder(goal[2] - start[2], math.tau)) / self.speeds[2])

    def ready(self, seed: int) -> Ready:
        """Record its log, learn it, and say how it is driven."""
        random = np.random.default_rng([seed, 29])
        commands = held(random, self.speeds, self.dt, HELD["omni"])
        with TemporaryDirectory() as folder:
            log, names = Path(folder) / "omni.csv", ("v", "vy", "omega")
            record(log, self, self.moves(seed + 1), commands, random, commands, names)
            model = learn(load_logs([log], self.dt), [log]).model
        body: dict[str, Any] = {"footprint": self.footprint}
        problem = NavigationProblem(
            dt=self.dt,
            u_min=tuple(-speed for speed in self.speeds),
            u_max=self.speeds,
            wheels=Omni(),
            **(body if self.footprint else {"robot_radius": self.radius}),
        )
        return Ready(model, problem, self.moves(seed))

    def moves(self, seed: int) -> Moves:
        """What is asked for speeds; a seed of its slip."""
        return OmniPlant(self.rollers, self.dt, seed)


def draw_car(seed: int) -> CarRobot:
    """Draw a car: from a desk's toy to a delivery van."""
    random = np.random.default_rng([seed, 31])
    uniform = random.uniform
    base = float(np.exp(uniform(np.log(0.06), np.log(2.5))))
    behind, before, width = base * uniform((0.1, 0.1, 0.5), (0.3, 0.3, 0.8))
    length = base + behind + before
    speed = base * float(np.exp(uniform(np.log(0.7), np.log(3.0))))
    lock = math.radians(uniform(22.0, 40.0))
    lags, ramped, noisy, bent = random.random(4) < (0.6, 0.5, 0.6, 0.5)
    follower = Follower(
        float(uniform(0.0, 0.12)) if lags else 0.0,
        (speed / uniform(0.2, 1.0) if ramped else math.inf, 2.0 * lock / uniform(0.3, 1.5)),
        tuple(uniform((0.05, 0.03), (0.3, 0.12))) if lags else (0.0, 0.0),
    )
    chassis = Chassis(
        base,
        lock,
        follower,
        gains=(uniform(0.9, 1.05), uniform(0.8, 1.05)),
        understeer=uniform(0.0, 0.25) / speed**2,
        offset=math.radians(uniform(-2.0, 2.0)) if bent else 0.0,
        slip=uniform(0.0, 0.05),
    )
    return CarRobot(
        "car",
        chassis,
        Footprint.rectangle(length, width, 0.5 * (behind - base - before)),
        0.5 * math.hypot(length, width),
        speed,
        float(random.choice((0.05, 0.1, 0.1, 0.2))),
        (0.015 * width, 0.01) if noisy else (0.0, 0.0),
        str(random.choice(STEERING)),
    )


def draw_omni(seed: int) -> OmniRobot:
    """Draw an omni: round or a rectangle, from a desk's toy to a platform for pallets."""
    random = np.random.default_rng([seed, 37])
    uniform = random.uniform
    radius = float(np.exp(uniform(np.log(0.04), np.log(1.0))))
    speed = radius * float(np.exp(uniform(np.log(1.5), np.log(5.0))))
    speeds = (speed, speed * float(uniform(0.6, 1.0)), float(uniform(0.5, 2.5)))
    is_round, lags, ramped, noisy = random.random(4) < (0.5, 0.6, 0.4, 0.6)
    ramp = uniform(0.2, 1.0)
    lag = uniform(0.05, 0.3) if lags else 0.0
    follower = Follower(
        uniform(0.0, 0.12) if lags else 0.0,
        tuple(most / ramp if ramped else math.inf for most in speeds),
        (lag,) * 3,
    )
    rollers = Rollers(
        follower,
        gains=tuple(uniform((0.9, 0.85, 0.5, 0.6), (1.05, 1.05, 1.0, 1.05))),
        crosstalk=uniform(-0.1, 0.1) / radius,
        slip=uniform(0.0, 0.1),
    )
    slim = math.atan(uniform(0.75, 1.0))
    sides = 2.0 * radius * math.cos(slim), 2.0 * radius * math.sin(slim)
    return OmniRobot(
        "omni, round" if is_round else "omni, square",
        rollers,
        None if is_round else Footprint.rectangle(*sides),
        radius,
        speeds,
        float(random.choice((0.05, 0.1, 0.1, 0.2))),
        (0.03 * radius, 0.01) if noisy else (0.0, 0.0),
    )


def held(random: np.random.Generator, most: tuple[float, ...], dt: float, lasts: float) -> Array:
    """Commands (n, m) between bounds, each held for a time [s]."""
    count, hold = round(SECONDS / dt), max(round(lasts / dt), 1)
    drawn = random.uniform(-1.0, 1.0, (count // hold + 1, len(most))) * most
    out: Array = np.repeat(drawn, hold, axis=0)[:count]
    return out


def record(
    log: Path,
    robot: CarRobot | OmniRobot,
    plant: Moves,
    commands: Array,
    random: np.random.Generator,
    told: Array,
    names: tuple[str, ...],
) -> None:
    """Write a table of poses as measured while commands (n, m) are driven, and what is told."""
    (place, turn), poses = robot.noise, [np.zeros(3)]
    for command in commands:
        poses.append(plant.drive(poses[-1], command)[-1])
    seen = np.array(poses) + random.normal(size=(len(poses), 3)) * (place, place, turn)
    time = robot.dt * np.arange(len(poses))
    rows = np.column_stack([time, seen, np.concatenate([told, told[-1:]])])
    header = ",".join(("t", "x", "y", "theta", *names))
    np.savetxt(log, rows, fmt="%.9g", delimiter=",", header=header, comments="")
