"""Drives of cars to where they park, judged by the true pose and the exact outline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.sim.periods import periods
from kmpc_lab.studies.parking.cars import DT, Bicycle, DrawnCar, random_car
from kmpc_lab.studies.parking.scenes import Scene, scene_of
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Controller
from kmpc_lite.control.kernels.reeds_shepp import curves
from kmpc_lite.control.plan import Plan
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.arrival import in_pose
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.types import Array

HELD = 1.0
"""How long the car must hold its goal [s]."""
MOST_TIMES, MOST = 10.0, 60.0
"""A drive ends after so many times the shortest one's time, and so many lengths at full speed."""
FEW = 3
"""Changes of gear that are few."""
CREEPS = 0.02
"""Share of its speed below which a car that is steered where it waits has no gear."""


@dataclass(frozen=True)
class Parked:
    """What became of one drive."""

    kind: str
    seed: int
    in_pose: bool
    collided: bool
    seconds: float
    shortest_seconds: float
    """Of the shortest curve of Reeds and Shepp, whatever is in its way, at full speed."""
    gear_changes: int
    clearance: float
    """Least one of the exact outline, in lengths of the car."""
    ended: str
    """Progress that was reported at the end, and its reason."""


def shortest_seconds(car: DrawnCar, start: Array, goal: Array) -> float:
    """Time of the shortest curve of Reeds and Shepp at full speed."""
    x, y, turn = goal - start
    cos, sin = math.cos(start[2]), math.sin(start[2])
    seen = (cos * x + sin * y) / car.radius, (cos * y - sin * x) / car.radius, turn
    lengths = np.abs(curves(np.array([seen]))).sum(axis=-1)
    return float(lengths.min()) * car.radius / car.speed


def drive(kind: str, seed: int) -> Parked:
    """Draw a car and a scene, and drive."""
    car = random_car(seed)
    return judge(kind, seed, car, scene_of(kind, car, seed))


def judge(kind: str, seed: int, car: DrawnCar, scene: Scene) -> Parked:
    """Drive, and judge by the true poses."""
    problem, footprint = car.problem(), car.footprint
    controller = Controller(nominal_unicycle(DT), problem)
    tolerance = in_pose(problem.body_radius, np.zeros(3))
    shortest = shortest_seconds(car, scene.start, scene.goal)
    inside, changes, gear, clearance = 0.0, 0, 0.0, math.inf
    no_circles = np.empty((1, 0, 3))

    def step(pose: Array, k: int) -> Plan:
        return controller.step(pose, scene.goal, scene.solids)

    most = MOST_TIMES * shortest + MOST * car.length / car.speed
    bicycle = Bicycle(car, seed)
    for period in periods(step, bicycle.drive, scene.start, math.ceil(most / DT)):
        plan, poses = period.plan, period.poses
        speed = float(plan.command[0])
        if abs(speed) > CREEPS * car.speed:
            changes += speed * gear < 0.0
            gear = speed
        rows = np.repeat(no_circles, len(poses), axis=0)
        gaps = footprint_gaps(footprint, poses, rows, scene.solids)
        clearance = min(clearance, float(gaps.min()) / car.length)
        if clearance < 0.0:
            break
        inside = inside + DT if tolerance.met(poses[-1], scene.goal) else 0.0
        if inside >= HELD:
            break
    return Parked(
        kind,
        seed,
        inside >= HELD,
        clearance < 0.0,
        (period.number + 1) * DT - HELD,
        shortest,
        changes,
        clearance,
        f"{plan.progress.value}: {plan.reason}" if plan.reason else plan.progress.value,
    )


def study(kinds: Sequence[str], seeds: Sequence[int], work: Work) -> list[Parked]:
    """Drive a car of its own for each seed in a scene of every kind; rows in this order."""
    return work.rows("parking", product(kinds, seeds), drive, Parked)


def summary(rows: Sequence[Parked]) -> dict[str, Any]:
    """Counts of one kind's drives."""
    there = [row for row in rows if row.in_pose]
    times = [row.seconds / row.shortest_seconds for row in there]
    changes = [row.gear_changes for row in there]
    return {
        "drives": len(rows),
        "in_pose": len(there),
        "collisions": sum(row.collided for row in rows),
        "time_to_shortest": float(np.median(times)) if times else math.nan,
        "few_changes": sum(change <= FEW for change in changes) / len(rows),
        "changes": float(np.median(changes)) if changes else math.nan,
        "clearance": min(row.clearance for row in rows),
    }


def format_rows(rows: Sequence[Parked]) -> str:
    """Table with a row a kind, then every drive that did not end in pose."""
    lines = [
        f"{'':9} drives  in pose  collisions  time to shortest  changes of gear  "
        f"<= {FEW} changes  least clearance"
    ]
    for kind in [*dict.fromkeys(row.kind for row in rows), "all"]:
        s = summary([row for row in rows if kind in (row.kind, "all")])
        lines.append(
            f"{kind:9} {s['drives']:6d} {s['in_pose']:8d} {s['collisions']:11d} "
            f"{s['time_to_shortest']:17.2f} {s['changes']:16.1f} {100 * s['few_changes']:11.0f} % "
            f"{100 * s['clearance']:14.1f} %"
        )
    lines += [
        f"{row.kind}, car {row.seed}: {'touched' if row.collided else row.ended}"
        for row in rows
        if row.collided or not row.in_pose
    ]
    return "\n".join(lines)
