"""What a scan costs a step: drives by lidar beside drives past four circles that are told."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import free_pose, random_circles
from kmpc_lab.bench.quantiles import HEAD, QUANTILES, format_times, in_ms
from kmpc_lab.sim.lidar import LidarSpec, scan_of, scan_ranges
from kmpc_lab.studies.any_robot import STANDARD, RobotPlant
from kmpc_lab.studies.sight.worlds import KINDS, SIDE, course_of
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.scene import Obstacles
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.types import Array

LIDAR = LidarSpec(4.0)
STEPS = 160
"""Of a drive at most: about half the way through one of the worlds."""
CIRCLES = 4
PHASES = ("estimate", "guide", "solve", "verify", "total")
"""Of a step, as they are told; what a scan shows is looked at in ``estimate``."""


@dataclass(frozen=True, eq=False)
class _Drive:
    """Where a drive leads, and what the robot is told or sees on it."""

    start: Array
    goal: Array
    obstacles: Callable[[Array], Obstacles]


def lidar_steps(
    drives: int, seed: int, progress: Callable[[int, int], None] = lambda done, total: None
) -> list[dict[str, Any]]:
    """Time steps of one controller past four circles, and by a lidar of 360 beams, in turns.

    Drives are recorded first and repeated for the clock: neither the simulated lidar nor the plant
    comes in between.

    Parameters
    ----------
    drives : int
        Of either kind; those by lidar lead through the worlds of ``kmpc study sight`` in turns.
    seed : int
        Of the first; the others follow.
    progress : callable
        Called as drives finish.

    Returns
    -------
    list of dict
        For both kinds ``name``, ``steps``, ``ms`` (p50, p99, p99.9 and max of a whole step), and
        ``phases_ms`` (the same of each).
    """
    controller = Controller(nominal_unicycle(STANDARD.dt), STANDARD.problem(SIDE))
    kinds: dict[str, list[Mapping[str, float]]] = {f"{CIRCLES} circles": [], "scan, 360 beams": []}
    for i in range(drives):
        turns = (_past_circles(seed + i), _by_lidar(i, seed + i))
        for drive, laps in zip(turns, kinds.values(), strict=True):
            recorded = _record(controller, drive, seed + i)
            controller.reset()
            gc.collect()
            plans = [controller.step(*step) for step in recorded]
            # the first has no plan to start from
            laps += [plan.timing for plan in plans[1:]]
        progress(i + 1, drives)
    return [_told(name, laps) for name, laps in kinds.items()]


def _record(
    controller: Controller, drive: _Drive, seed: int
) -> list[tuple[Array, Array, Obstacles]]:
    """Pose, goal and obstacles of each step of a drive until the goal is held."""
    plant, pose = RobotPlant(STANDARD, seed), drive.start
    controller.reset()
    recorded: list[tuple[Array, Array, Obstacles]] = []
    while len(recorded) < STEPS:
        step = pose, drive.goal, drive.obstacles(pose)
        plan = controller.step(*step)
        if plan.holding:
            break  # standing there costs next to nothing
        recorded.append(step)
        pose = plant.drive(pose, plan.command)[-1]
    return recorded


def _past_circles(seed: int) -> _Drive:
    """A drive past circles that are told."""
    random = np.random.default_rng(seed)
    circles = random_circles(random, CIRCLES)
    ends = free_pose(random, circles), free_pose(random, circles)
    return _Drive(*ends, lambda pose: circles)


def _by_lidar(which: int, seed: int) -> _Drive:
    """A drive through a world that nobody has told."""
    course = course_of(list(KINDS)[which % len(KINDS)], seed, STANDARD.radius)
    random = np.random.default_rng([seed, 9])

    def look(pose: Array) -> list[LaserScan]:
        ranges, _ = scan_ranges(course.world, LIDAR, pose, random)
        return [scan_of(LIDAR, ranges)]

    return _Drive(course.start, course.goal, look)


def _told(name: str, laps: Sequence[Mapping[str, float]]) -> dict[str, Any]:
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
