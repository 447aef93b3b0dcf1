"""Study ``parking``: cars driven to where they park, judged by the true pose and exact outline."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lab.studies.drive import DriveResult, drive_past
from kmpc_lab.studies.parking.cars import DT, Bicycle, DrawnCar, random_car
from kmpc_lab.studies.parking.scenes import Scene, scene_of
from kmpc_lab.studies.table import DRIVES, GAP, Column, Rows, median_of, time_to_ideal
from kmpc_lite.control import Controller
from kmpc_lite.control.kernels.reeds_shepp import curves
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.types import Array

MOST_TIMES, MOST = 10.0, 60.0
"""A drive ends after so many times the shortest one's time, and so many lengths at full speed."""
FEW = 3
"""Changes of gear that are few."""


def few_changes(rows: Rows) -> float:
    """Share of the drives that arrived with few changes of gear."""
    return sum(row.arrived and row.gear_changes <= FEW for row in rows) / len(rows)


COLUMNS = (
    *DRIVES,
    Column("time to shortest", ".2f", time_to_ideal),
    Column("changes of gear", ".1f", median_of("gear_changes")),
    Column(f"<= {FEW} changes", ".0%", few_changes),
    GAP,
)
"""The ideal is the shortest curve of Reeds and Shepp, whatever is in its way, at full speed."""


def shortest_seconds(car: DrawnCar, start: Array, goal: Array) -> float:
    """Time of the shortest curve of Reeds and Shepp at full speed."""
    x, y, turn = goal - start
    cos, sin = math.cos(start[2]), math.sin(start[2])
    seen = (cos * x + sin * y) / car.radius, (cos * y - sin * x) / car.radius, turn
    lengths = np.abs(curves(np.array([seen]))).sum(axis=-1)
    return float(lengths.min()) * car.radius / car.speed


def drive(kind: str, seed: int) -> DriveResult:
    """Draw a car and a scene, and drive."""
    car = random_car(seed)
    return judge(seed, car, scene_of(kind, car, seed))


def judge(seed: int, car: DrawnCar, scene: Scene) -> DriveResult:
    """Drive, and judge by the true poses."""
    shortest = shortest_seconds(car, scene.start, scene.goal)

    def gaps(poses: Array) -> Array:
        return footprint_gaps(car.footprint, poses, np.empty((len(poses), 0, 3)), scene.solids)

    return drive_past(
        Controller(nominal_unicycle(DT), car.problem()),
        Bicycle(car, seed).drive,
        (scene.start, scene.goal),
        scene.solids,
        gaps,
        (shortest, MOST_TIMES * shortest + MOST * car.length / car.speed),
    )
