"""Drives of cars to where they park, judged by the true pose and the exact outline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from kmpc_lab.studies import drive_results
from kmpc_lab.studies.drive_results import Column, DriveResult, closed_loop
from kmpc_lab.studies.parking.cars import DT, Bicycle, DrawnCar, random_car
from kmpc_lab.studies.parking.scenes import Scene, scene_of
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Controller
from kmpc_lite.control.kernels.reeds_shepp import curves
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.types import Array

MOST_TIMES, MOST = 10.0, 60.0
"""A drive ends after so many times the shortest one's time, and so many lengths at full speed."""
FEW = 3
"""Changes of gear that are few."""


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan


def _changes(rows: Sequence[DriveResult]) -> list[int]:
    return [row.gear_changes for row in rows if row.arrived]


COLUMNS = (
    *drive_results.DRIVES,
    Column("time to shortest", ".2f", drive_results.time_to_ideal),
    Column("changes of gear", ".1f", lambda rows: _median(_changes(rows))),
    Column(
        f"<= {FEW} changes", ".0%", lambda rows: sum(c <= FEW for c in _changes(rows)) / len(rows)
    ),
    Column("least clearance [m]", ".3f", lambda rows: min(row.clearance for row in rows)),
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
    return judge(kind, seed, car, scene_of(kind, car, seed))


def judge(kind: str, seed: int, car: DrawnCar, scene: Scene) -> DriveResult:
    """Drive, and judge by the true poses."""
    controller = Controller(nominal_unicycle(DT), car.problem())
    shortest = shortest_seconds(car, scene.start, scene.goal)

    def gaps(poses: Array) -> Array:
        return footprint_gaps(car.footprint, poses, np.empty((len(poses), 0, 3)), scene.solids)

    limit = MOST_TIMES * shortest + MOST * car.length / car.speed
    task = drive_results.Drive(
        scene.start, scene.goal, shortest, limit, lambda pose: scene.solids, gaps
    )
    return closed_loop((kind,), seed, controller, Bicycle(car, seed).drive, task)


def study(kinds: Sequence[str], seeds: Sequence[int], work: Work) -> list[DriveResult]:
    """Drive a car of its own for each seed in a scene of every kind; rows in this order."""
    return work.rows("parking", product(kinds, seeds), drive, DriveResult)


def format_rows(rows: Sequence[DriveResult]) -> str:
    """Table with a row a kind, then every drive that did not end in pose."""
    return drive_results.table(rows, COLUMNS, "car", "all")
