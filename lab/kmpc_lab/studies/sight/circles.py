"""Circles that are given when they are near: how the speed follows from the reach of sight.

Arrived means that the controller says it holds its goal (`Plan.holding`); poses are exact here, so
that is where it is. A collision is an overlap at any of four looks a period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from kmpc_lab.peers.paper import AREA
from kmpc_lab.sim.closed_loop import SUBSAMPLES
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.sim.periods import periods
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.records import Work
from kmpc_lab.studies.training import DT
from kmpc_lite.control import Circle, Controller, NavigationProblem
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.gaps import obstacle_gaps
from kmpc_lite.types import Array

REACHES = 2.0, 1.0, 0.5, 0.3
SPEEDS = 0.6, 1.5
DU_MAX = 1.5, 5.0
REACTION = 0.1
"""Time until a robot begins to brake, in the law that speeds are compared with [s]."""
LONGEST = 60.0
"""[s]."""


@dataclass(frozen=True)
class Reveal:
    """What became of one drive."""

    speed: float
    reach: float
    seed: int
    arrived: bool
    collided: bool
    seconds: float
    all_told: float
    """Time of the same drive with everything given [s]."""
    fastest: float
    stopped: float


def sight_law(reach: float, fastest: float) -> float:
    """Speed at which a robot stops within its reach [m/s]: ``v t + v^2 / 2 a = reach``."""
    a = DU_MAX[0]
    return min(a * (math.sqrt(REACTION**2 + 2.0 * reach / a) - REACTION), fastest)


def drive(speed: float, reach: float, seed: int) -> Reveal:
    """Drive one map whose circles are given within reach, and once more with all of them given."""
    seconds, collided, fastest, stopped = _drive(speed, reach, seed)
    told, _, _, _ = _drive(speed, math.inf, seed)
    arrived = seconds < LONGEST
    return Reveal(speed, reach, seed, arrived, collided, seconds, told, fastest, stopped)


def _drive(speed: float, reach: float, seed: int) -> tuple[float, bool, float, float]:
    scenario, turn = random_map("open", seed), math.pi / 4 * speed / 0.6
    problem = NavigationProblem(
        **AREA,
        u_min=(-speed, -turn),
        u_max=(speed, turn),
        du_max=DU_MAX,
        sensor_range=reach if reach < math.inf else None,
    )
    controller = Controller(nominal_unicycle(DT), problem)
    plant = DifferentialDrive(seed=seed)
    circles = np.array([(c.x, c.y, c.radius) for c in scenario.circles])

    def step(pose: Array, number: int) -> Plan:
        gaps = np.hypot(*(circles[:, :2] - pose[:2]).T) - circles[:, 2] - problem.robot_radius
        return controller.step(pose, scenario.goal, [Circle(*c) for c in circles[gaps <= reach]])

    def move(pose: Array, command: Array) -> Array:
        return plant.trace(pose, command, DT, SUBSAMPLES)

    fastest, stopped, k = 0.0, 0, 0
    for period in periods(step, move, np.array(scenario.start), math.ceil(LONGEST / DT)):
        stopped += period.plan.status is PlanStatus.STOPPED
        fastest, k = max(fastest, abs(float(period.plan.command[0]))), k + 1
        if period.plan.holding:
            break
        if (obstacle_gaps(scenario, period.poses, np.zeros(SUBSAMPLES)) < 0.0).any():
            return LONGEST, True, fastest, stopped / k
    return k * DT, False, fastest, stopped / k


def study(work: Work, seeds: Sequence[int]) -> list[Reveal]:
    """Drive all speeds and reaches."""
    return work.rows("sight --circles", product(SPEEDS, REACHES, seeds), drive, Reveal)


def format_reveals(rows: Sequence[Reveal]) -> str:
    """Table of speed against reach."""
    lines = ["speed reach drives arrived hit stopped fastest  law  time/all told  law's"]
    for speed, reach in dict.fromkeys((row.speed, row.reach) for row in rows):
        some = [row for row in rows if (row.speed, row.reach) == (speed, reach)]
        law = sight_law(reach, speed)
        ratio = float(np.mean([row.seconds / row.all_told for row in some]))
        lines.append(
            f"{speed:5g} {reach:5g} {len(some):6d} {sum(r.arrived for r in some):7d} "
            f"{sum(r.collided for r in some):3d} {100 * np.mean([r.stopped for r in some]):6.1f}% "
            f"{np.mean([r.fastest for r in some]):7.2f} {law:4.2f} {ratio:13.2f} {speed / law:6.2f}"
        )
    return "\n".join(lines)
