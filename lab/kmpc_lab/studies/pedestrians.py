"""``kmpc study pedestrians``: drives among pedestrians that ignore the robot.

Touches are told apart by the truth: the robot *drives into* a pedestrian that it approaches at
the moment of the contact, having moved within the last second; it *is met* while it moves
otherwise; a robot that has stood for a second *is walked into*. Ten looks a period tell contacts,
which do not end the drive: it ends where the robot first is within the tolerances of its goal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec
from kmpc_lab.sim.pedestrians import Pedestrians, Walks
from kmpc_lab.sim.periods import periods
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.records import Record, Work
from kmpc_lab.studies.training import DT, REPORTING_SEED
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import Plan
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.arrival import ARRIVED
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

SEEN = ("told", "zero", "noisy", "lidar")
"""How the controller sees people: with their velocity, with zero, with zero and noise of the place,
or in scans alone."""
COUNTS = (4, 8)
NOISE = 0.01
"""Of noisy circles, along each axis [m]."""
STOOD = 1.0
"""How long a robot must have stood to be walked into [s]."""
STANDS = 0.01
"""Within how much of one place [m]."""
AT_REST = 1e-3
"""Speed up to which the robot approaches nobody: what is left of a command to stand [m/s]."""
APART = 0.1
"""How far apart they must be for the next contact to count [m]."""
TIMEOUT = 60.0
"""[s]"""
SLIP = 0.05
LIDAR = LidarSpec()


@dataclass
class CrowdCounts:
    """What became of one drive."""

    people: int
    turning: bool
    seen: str
    seed: int
    driven_into: int = 0
    met: int = 0
    walked_into: int = 0
    arrived: bool = False
    seconds: float = 0.0
    stopped: int = 0
    """Steps without a plan."""
    steps: int = 0


@dataclass(frozen=True)
class CrowdDrive:
    """A robot's way among people."""

    counts: CrowdCounts
    poses: Array
    """(T + 1, 3)."""
    circles: Array
    """(T + 1, M, 5)."""
    statuses: tuple[str, ...]
    contacts: tuple[tuple[float, str], ...]
    """When [s], and of which kind."""


def ends(seed: int, side: float) -> tuple[Array, Array]:
    """Start and goal (3,) of a drive across the area."""
    random, half = np.random.default_rng([seed, 2]), 0.4 * side
    while True:
        start, goal = random.uniform(-1.0, 1.0, (2, 3)) * (half, half, math.pi)
        if np.hypot(*(goal - start)[:2]) >= 0.5 * side:
            return start, goal


def drive(people: int, turning: bool, seen: str, seed: int) -> CrowdDrive:
    """Drive a robot of 0.15 m and 0.6 m/s across the area."""
    walks = Walks(people, turning)
    half = 0.5 * walks.side
    problem = NavigationProblem(x_min=(-half, -half, -np.inf), x_max=(half, half, np.inf))
    controller = Controller(nominal_unicycle(DT), problem)
    pose, goal = ends(seed, walks.side)
    crowd = Pedestrians(walks, seed, pose[:2])
    plant, noise = DifferentialDrive(SLIP, seed), np.random.default_rng([seed, 4])
    counts = CrowdCounts(people, turning, seen, seed)
    touching, trail = np.zeros(people, dtype=bool), [pose[:2]]
    poses, circles, statuses, contacts = [pose], [crowd.circles], list[str](), []

    def step(pose: Array, number: int) -> Plan:
        if seen == "lidar":
            return controller.step(pose, goal, [_scan(pose, crowd.circles, noise)])
        return controller.step(pose, goal, _as_seen(crowd.circles, seen, noise))

    def move(pose: Array, command: Array) -> Array:
        return plant.trace(pose, command, DT, LOOKS)

    for period in periods(step, move, pose, round(TIMEOUT / DT)):
        counts.stopped += period.plan.status.name == "STOPPED"
        for at, there in zip(period.poses, crowd.walk(DT, LOOKS), strict=True):
            trail.append(at[:2])
            gaps = np.hypot(*(there - at[:2]).T) - walks.radius - problem.robot_radius
            for i in np.flatnonzero((gaps < 0.0) & ~touching):
                kind = _kind(np.array(trail), there[i])
                setattr(counts, kind, getattr(counts, kind) + 1)
                contacts.append((counts.steps * DT, kind))
            touching = (gaps < 0.0) | (touching & (gaps < APART))
        counts.steps += 1
        poses.append(period.poses[-1])
        circles.append(crowd.circles)
        statuses.append(period.plan.status.name)
        counts.arrived = bool(ARRIVED.met(period.poses[-1], goal))
        if counts.arrived:
            break
    counts.seconds = round(counts.steps * DT, 3)
    return CrowdDrive(counts, np.array(poses), np.array(circles), tuple(statuses), tuple(contacts))


def _as_seen(circles: Array, seen: str, noise: np.random.Generator) -> Array:
    """Circles as they are given to the controller."""
    if seen == "told":
        return circles
    circles[:, 3:] = 0.0
    if seen == "noisy":
        circles[:, :2] += NOISE * noise.normal(size=(len(circles), 2))
    return circles


def _scan(pose: Array, circles: Array, noise: np.random.Generator) -> LaserScan:
    """What a scanner in the robot's middle sees, with noise and beams that come back without."""
    directions = math.tau / LIDAR.beams * np.arange(LIDAR.beams)
    world = World(circles, np.empty((0, 4)))
    ranges = world.ranges(pose[:2], pose[2] + directions)
    ranges += LIDAR.noise * noise.normal(size=LIDAR.beams)
    ranges[ranges > LIDAR.reach] = np.inf
    ranges[noise.random(LIDAR.beams) < LIDAR.dropout] = np.nan
    return LaserScan(ranges, 0.0, math.tau / LIDAR.beams, LIDAR.reach, range_min=LIDAR.nearest)


def _kind(trail: Array, place: Array) -> str:
    """Tell a contact with somebody at a place (2,), after a robot's trail (n, 2)."""
    second = trail[-round(STOOD / DT * LOOKS) - 1 :]
    if np.hypot(*(second - trail[-1]).T).max() <= STANDS:
        return "walked_into"
    moved, away = trail[-1] - trail[-2], place - trail[-1]
    approach = float(moved @ away) / float(np.hypot(*away)) * LOOKS / DT
    return "driven_into" if approach > AT_REST else "met"


def drive_record(people: int, turning: bool, seen: str, seed: int) -> Record:
    """Drive, and give plain numbers: what a worker does."""
    return asdict(drive(people, turning, seen, seed).counts)


def study(
    work: Work,
    drives: int = 200,
    counts: Sequence[int] = COUNTS,
    seen: Sequence[str] = SEEN,
    first_seed: int = REPORTING_SEED,
) -> list[Record]:
    """Drive every kind of crowd, so many times each, seen in every way; one record a drive."""
    seeds = range(first_seed, first_seed + drives)
    wanted = product(counts, (False, True), seen, seeds)
    return work.drive(wanted, drive_record, _key, "a drive of a pedestrians study")


def _key(record: Record) -> tuple[int, bool, str, int]:
    return (
        int(record["people"]),
        bool(record["turning"]),
        str(record["seen"]),
        int(record["seed"]),
    )


def rows(records: Sequence[Record]) -> list[dict[str, Any]]:
    """One row for each kind of crowd and way of seeing it."""
    kinds = dict.fromkeys(_key(r)[:3] for r in records)
    return [
        _row(people, turning, seen, [r for r in records if _key(r)[:3] == (people, turning, seen)])
        for people, turning, seen in kinds
    ]


def _row(people: int, turning: bool, seen: str, records: Sequence[Record]) -> dict[str, Any]:
    seconds = [r["seconds"] for r in records if r["arrived"]]
    return {
        "people": people,
        "walks": "turning" if turning else "straight",
        "seen": seen,
        "drives": len(records),
        **{name: sum(r[name] for r in records) for name in ("driven_into", "met", "walked_into")},
        "arrived": len(seconds),
        "median_s": float(np.median(seconds)) if seconds else math.nan,
        "p90_s": float(np.quantile(seconds, 0.9)) if seconds else math.nan,
        "stopped": sum(r["stopped"] for r in records) / sum(r["steps"] for r in records),
    }


def format_rows(records: Sequence[Record]) -> str:
    """Table with a row for each kind of crowd and way of seeing it."""
    lines = [
        f"{'people':>6} {'walks':9} {'velocity':9}{'drives':>7}{'drives into':>12}{'is met':>8}"
        f"{'is walked into':>15}{'arrived':>9}{'median':>8}{'p90':>8}{'STOPPED':>9}"
    ]
    for row in rows(records):
        lines.append(
            f"{row['people']:6d} {row['walks']:9} {row['seen']:9}{row['drives']:7d}"
            f"{row['driven_into']:12d}{row['met']:8d}{row['walked_into']:15d}{row['arrived']:9d}"
            f"{row['median_s']:6.1f} s{row['p90_s']:6.1f} s{100 * row['stopped']:7.1f} %"
        )
    lines.append(
        "drives into: approaches whom it touches; is met: moves otherwise, or stands for less than "
        f"{STOOD:g} s; is walked into: has stood for {STOOD:g} s"
    )
    return "\n".join(lines)
