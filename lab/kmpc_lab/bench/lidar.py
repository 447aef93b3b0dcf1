"""What a scan costs a step: drives by lidar beside drives past four known circles."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import free_pose, random_circles
from kmpc_lab.bench.measure import HEAD, QUANTILES, format_times, in_ms
from kmpc_lab.sim.lidar import LidarSpec, scan_of, scan_ranges
from kmpc_lab.studies.any_robot import STANDARD, RobotPlant
from kmpc_lab.studies.sight.worlds import KINDS, SIDE, course_of
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.scene import Obstacles
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.types import Array

REACH = 4.0
"""How far the scanner sees [m]."""
BEAMS = (360, 720, 1440)
STEPS = 160
"""Of a drive at most: about half the way through one of the worlds."""
CIRCLES = 4
PHASES = ("estimate", "guide", "solve", "verify", "total")
"""Of a step; what a scan shows is looked at in ``estimate``."""
Step = tuple[Array, Array, Obstacles, Array | None]
"""Pose, goal, obstacles and command sent before of a recorded step."""


@dataclass(frozen=True, eq=False)
class _Drive:
    """Where a drive leads, and what the robot knows or sees on it."""

    start: Array
    goal: Array
    obstacles: Callable[[Array], Obstacles]


def lidar_steps(
    drives: int, seed: int, progress: Callable[[int, int], None] = lambda done, total: None
) -> list[dict[str, Any]]:
    """Time steps of one controller past four circles, and by lidars of `BEAMS`, in turns.

    Drives are recorded first and repeated for the clock: neither the simulated lidar nor the plant
    comes in between.

    Parameters
    ----------
    drives : int
        Of each kind; those by lidar lead through the worlds of ``kmpc study sight`` in turns.
    seed : int
        Of the first; the others follow.
    progress : callable
        Called as drives finish.

    Returns
    -------
    list of dict
        For each kind ``name``, ``steps``, ``ms`` (p50, p99, p99.9 and max of a whole step), and
        ``phases_ms`` (the same of each).
    """
    controller = make_controller()
    laps: dict[str, list[Mapping[str, float]]] = {}
    for i in range(drives):
        for name, recorded in record_turn(controller, i, seed + i).items():
            controller.reset()
            gc.collect()
            plans = [controller.step(*step) for step in recorded]
            # the first has no plan to start from
            laps.setdefault(name, []).extend(plan.timing for plan in plans[1:])
        progress(i + 1, drives)
    return [_as_dict(name, found) for name, found in laps.items()]


def make_controller() -> Controller:
    """The controller that is timed."""
    return Controller(nominal_unicycle(STANDARD.dt), STANDARD.problem(SIDE))


def record_turn(controller: Controller, which: int, seed: int) -> dict[str, list[Step]]:
    """Record a drive of each kind, by name: past circles, and by a lidar of each of `BEAMS`."""
    kinds = {f"{CIRCLES} circles": _past_circles(seed)}
    kinds |= {f"scan, {beams} beams": _by_lidar(which, seed, beams) for beams in BEAMS}
    return {name: _record(controller, drive, seed) for name, drive in kinds.items()}


def _record(controller: Controller, drive: _Drive, seed: int) -> list[Step]:
    """Pose, goal and obstacles of each step of a drive until the goal is held."""
    plant, pose = RobotPlant(STANDARD, seed), drive.start
    controller.reset()
    recorded: list[Step] = []
    sent: Array | None = None
    while len(recorded) < STEPS:
        step = pose, drive.goal, drive.obstacles(pose), sent
        plan = controller.step(*step)
        if plan.holding:
            break  # standing there costs next to nothing
        recorded.append(step)
        pose, sent = plant.drive(pose, plan.command)[-1], plan.command
    return recorded


def _past_circles(seed: int) -> _Drive:
    """A drive past known circles."""
    random = np.random.default_rng(seed)
    circles = random_circles(random, CIRCLES)
    ends = free_pose(random, circles), free_pose(random, circles)
    return _Drive(*ends, lambda pose: circles)


def _by_lidar(which: int, seed: int, beams: int) -> _Drive:
    """A drive through an unknown world."""
    lidar = LidarSpec(REACH, beams=beams)
    course = course_of(list(KINDS)[which % len(KINDS)], seed, STANDARD.radius)
    random = np.random.default_rng([seed, 9])

    def look(pose: Array) -> list[LaserScan]:
        ranges, _ = scan_ranges(course.world, lidar, pose, random)
        return [scan_of(lidar, ranges)]

    return _Drive(course.start, course.goal, look)


def _as_dict(name: str, laps: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Plain values, for JSON."""
    phases = {phase: in_ms([lap.get(phase, 0.0) for lap in laps]) for phase in PHASES}
    return {"name": name, "steps": len(laps), "ms": phases["total"], "phases_ms": phases}


def format_lidar_steps(rows: Sequence[dict[str, Any]]) -> str:
    """Render `lidar_steps` as a table; ratios are to the first row."""
    lines = [f"{'':<18}{'steps':>7}{HEAD}{''.join(f'{p:>8}' for p in QUANTILES)} x first"]
    first = rows[0]["ms"]
    for row in rows:
        t = row["ms"]
        lines.append(
            f"{row['name']:<18}{row['steps']:>7}{format_times(t)}     "
            + "".join(f"{t[p] / first[p]:8.2f}" for p in QUANTILES)
        )
    lines.append("")
    for row in rows:
        phases = ", ".join(
            f"{name} {t['p50']:.3f}, {t['p99']:.3f}" for name, t in row["phases_ms"].items()
        )
        lines.append(f"{row['name']:<18} p50, p99 by phase [ms]: {phases}")
    return "\n".join(lines)
