"""Study ``parking``: cars driven to where they park, judged by the true pose and exact outline."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kmpc_lab.studies.drive import DriveResult, drive_past
from kmpc_lab.studies.parking.cars import DT, Bicycle, DrawnCar, random_car
from kmpc_lab.studies.parking.scenes import Scene, scene_of
from kmpc_lab.studies.table import DRIVES, GAP, JERK, TIME, Column, Rows, median_of
from kmpc_lite.control import Controller
from kmpc_lite.control.kernels.reeds_shepp import TURNS, curves
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.types import Array

MOST_TIMES, MOST = 10.0, 60.0
"""A drive ends after so many times the least time, and so many lengths at full speed."""
FEW = 3
"""Changes of gear that are few."""


def few_changes(rows: Rows) -> float:
    """Share of the drives that arrived with few changes of gear."""
    return sum(row.arrived and row.gear_changes <= FEW for row in rows) / len(rows)


COLUMNS = (
    *DRIVES,
    TIME,
    Column("changes of gear", ".1f", median_of("gear_changes")),
    Column(f"<= {FEW} changes", ".0%", few_changes),
    JERK,
    GAP,
)
"""The ideal is the quickest curve of Reeds and Shepp, whatever is in its way."""
KINDS_OF_CARS: dict[str, Callable[[DrawnCar], DrawnCar]] = {
    "open, forward only": lambda car: replace(car, reverse=False),
    "open, slow steering": lambda car: replace(car, steering_rate=STEERS / car.length),
}
"""Cars that are driven in the open."""
STEERS = 0.35 / 0.6
"""Change of a curvature in a second, times a car's length: 0.35 rad/s by wheels 0.6 lengths apart.
"""


def least_seconds(car: DrawnCar, start: Array, goal: Array) -> float:
    """Time of the quickest curve of Reeds and Shepp at full speed, and of the steering between.

    A curve that is driven exactly stands where its curvature changes, until the wheels have turned.
    The curves of Dubins that are arc, straight, arc take the place of a car's that only drives
    ahead.
    """
    x, y, turn = goal - start
    cos, sin = math.cos(start[2]), math.sin(start[2])
    seen = (cos * x + sin * y) / car.radius, (cos * y - sin * x) / car.radius, turn
    lengths, turns = (curves(np.array([seen]))[0], TURNS) if car.reverse else ahead(*seen)
    # segments of no length are not steered for
    bends = [some[np.abs(length) > 1e-6] for some, length in zip(turns, lengths, strict=True)]
    jumps = np.array([np.abs(np.diff(some, prepend=0.0)).sum() for some in bends])
    steers = 0.0 if car.steering_rate is None else 1.0 / (car.radius * car.steering_rate)
    driven = np.abs(lengths).sum(axis=1) * car.radius / car.speed
    return float((driven + steers * jumps).min())


def ahead(x: float, y: float, turn: float) -> tuple[Array, Array]:
    """Lengths and turns (W, 3) of Dubins's words to an end, in turning radii."""
    lengths, turns = [], []
    for side in (1.0, -1.0):
        phi, up = side * turn, side * y
        dx, dy = x - math.sin(phi), up - 1.0 + math.cos(phi)
        first = math.atan2(dy, dx) % math.tau
        lengths.append((first, math.hypot(dx, dy), (phi - first) % math.tau))
        turns.append((side, 0.0, side))
        dx, dy = x + math.sin(phi), up - 1.0 - math.cos(phi)
        if (square := dx * dx + dy * dy - 4.0) >= 0.0:
            far = math.sqrt(square)
            first = (math.atan2(dy, dx) + math.atan2(2.0, far)) % math.tau
            lengths.append((first, far, (first - phi) % math.tau))
            turns.append((side, 0.0, -side))
    return np.array(lengths), np.array(turns)


def drive(kind: str, seed: int) -> DriveResult:
    """Draw a car and a scene, and drive."""
    car = random_car(seed)
    if kind in KINDS_OF_CARS:
        car = KINDS_OF_CARS[kind](car)
    return judge(seed, car, scene_of(kind.partition(",")[0], car, seed))


def judge(seed: int, car: DrawnCar, scene: Scene) -> DriveResult:
    """Drive, and judge by the true poses."""
    least = least_seconds(car, scene.start, scene.goal)

    return drive_past(
        Controller(nominal_unicycle(DT), car.problem()),
        Bicycle(car, seed).drive,
        (scene.start, scene.goal),
        scene.solids,
        (least, MOST_TIMES * least + MOST * car.length / car.speed),
    )
