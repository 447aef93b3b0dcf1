"""``kmpc study jumps``: drives whose pose jumps again and again.

The pose that the controller is given is wrong for one sample, or for a second, in position or in
heading, and true again; or the frame of poses and obstacles moves for good. Collisions are judged
by the truth at ten looks a period. A drive ends where the robot first is within the tolerances of
its goal, in the frame as it is then: it need not stay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.sim.periods import periods
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.records import Record, Work
from kmpc_lab.studies.training import DT, REPORTING_SEED
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import GoalProgress, Plan
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.gaps import obstacle_gaps
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

KINDS = ("one sample", "a second", "heading", "for good")
SIZES = (0.05, 0.1, 0.3, 1.0)
"""Sizes of the jumps [m]; a heading jumps by as many radians."""
FAMILY = "dense"
BETWEEN = (2.0, 5.0)
"""Time from the end of a jump to the next one [s]."""
LASTS = 1.0
"""How long a pose stays wrong, where it is not for a single sample [s]."""
TIMEOUT = 60.0
"""[s]"""
SLIP = 0.05


class Jumps:
    """When the pose is wrong, and by how much.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    size : float
        [m], of a heading [rad].
    seed : int
        Of times and directions.
    """

    def __init__(self, kind: str, size: float, seed: int) -> None:
        self._kind, self._size = kind, size
        self._random = np.random.default_rng([seed, 5])
        self.count = 0
        self.frame = np.zeros(3)
        """By how much the frame has moved for good."""
        self._off = np.zeros(3)
        self._begin = self._random.uniform(*BETWEEN)
        self._end = math.inf

    def at(self, time: float) -> Array:
        """By how much the pose is wrong (3,) at a time [s], beside the frame."""
        if time >= self._end:
            self._off, self._end = np.zeros(3), math.inf
            self._begin = time + self._random.uniform(*BETWEEN)
        if time >= self._begin:
            self._begin = math.inf
            self._jump(time)
        return self._off

    def _jump(self, time: float) -> None:
        self.count += 1
        direction = self._random.uniform(-math.pi, math.pi)
        off = self._size * np.array([math.cos(direction), math.sin(direction), 0.0])
        if self._kind == "heading":
            off = np.array([0.0, 0.0, math.copysign(self._size, direction)])
        if self._kind == "for good":
            self.frame, self._end = self.frame + off, time
        else:
            self._off = off
            self._end = time + (0.5 * DT if self._kind == "one sample" else LASTS)


def drive(kind: str, size: float, seed: int) -> Record:
    """Drive one map; plain numbers of what became of it."""
    scenario = random_map(FAMILY, seed, SLIP)
    controller = Controller(nominal_unicycle(DT), scenario.problem())
    jumps, plant = Jumps(kind, size, seed), DifferentialDrive(SLIP, seed)
    goal, circles = np.array(scenario.goal), scenario.circles_at(0.0)
    waited = 0

    def step(pose: Array, k: int) -> Plan:
        off, frame = jumps.at(k * DT), jumps.frame
        return controller.step(pose + off + frame, goal, circles + (*frame[:2], 0.0, 0.0, 0.0))

    def move(pose: Array, command: Array) -> Array:
        return plant.trace(pose, command, DT, LOOKS)

    for period in periods(step, move, np.array(scenario.start), round(TIMEOUT / DT)):
        waited += period.plan.progress is GoalProgress.WAITING
        collided = bool((obstacle_gaps(scenario, period.poses, np.zeros(LOOKS)) < 0.0).any())
        arrived = bool(scenario.arrival.met(period.poses[-1] + jumps.frame, goal))
        if collided or arrived:
            break
    return {
        "kind": kind,
        "size": size,
        "seed": seed,
        "jumps": jumps.count,
        "collided": collided,
        "arrived": arrived and not collided,
        "seconds": round((period.number + 1) * DT, 3),
        "waited": round(waited * DT, 3),
    }


def study(
    work: Work,
    drives: int = 100,
    kinds: Sequence[str] = KINDS,
    sizes: Sequence[float] = SIZES,
    first_seed: int = REPORTING_SEED,
) -> list[Record]:
    """Drive every kind and size of jump over the same maps; one record a drive."""
    seeds = range(first_seed, first_seed + drives)
    return work.drive(product(kinds, sizes, seeds), drive, _key, "a drive of a jumps study")


def _key(record: Record) -> tuple[str, float, int]:
    return str(record["kind"]), float(record["size"]), int(record["seed"])


def rows(records: Sequence[Record]) -> list[dict[str, Any]]:
    """One row for each kind and size."""
    found = []
    for kind, size in dict.fromkeys(_key(r)[:2] for r in records):
        of_it = [r for r in records if _key(r)[:2] == (kind, size)]
        seconds = [r["seconds"] for r in of_it if r["arrived"]]
        found.append(
            {
                "kind": kind,
                "size": size,
                "drives": len(of_it),
                "jumps": sum(r["jumps"] for r in of_it),
                "collisions": sum(r["collided"] for r in of_it),
                "arrived": len(seconds),
                "median_s": float(np.median(seconds)) if seconds else math.nan,
                "waited_s": float(np.mean([r["waited"] for r in of_it])),
            }
        )
    return found


def format_rows(records: Sequence[Record]) -> str:
    """Table with a row for each kind and size."""
    lines = [
        f"{'the pose is wrong':18}{'by':>9}{'drives':>8}{'jumps':>7}{'collisions':>12}"
        f"{'arrived':>9}{'median':>9}{'waits':>8}"
    ]
    for row in rows(records):
        unit = "rad" if row["kind"] == "heading" else "m"
        lines.append(
            f"{row['kind']:18}{row['size']:5g} {unit:3}{row['drives']:8d}{row['jumps']:7d}"
            f"{row['collisions']:12d}{row['arrived']:9d}{row['median_s']:7.1f} s"
            f"{row['waited_s']:6.1f} s"
        )
    return "\n".join(lines)
