"""Drives through cylinders by lidar alone: a kinematic replica of the challenge, judged by truth.

The robot is Jackal-like and is learned from 180 s of its own log. As in the challenge a drive
begins when it has moved 0.1 m, ends within a metre of the goal, by a touch or after 100 s, and the
metric is the ideal time (the way at 2 m/s) over the time, which counts as at least twice and at
most eight times the ideal one: half a point at most.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from kmpc_lab.studies.any_robot import RobotPlant
from kmpc_lab.studies.clutter.drivers import (
    BEAMS,
    CONDITIONS,
    DRIVERS,
    JACKAL,
    MOUNT,
    OUTLINE,
    REACH,
    VIEW,
    Condition,
    Driver,
    Ours,
    Theirs,
)
from kmpc_lab.studies.clutter.worlds import Cylinders, draw_field, draw_moving, read_barn
from kmpc_lab.studies.drive_results import Column, count_of, jerk, mean_of, table
from kmpc_lab.studies.records import Work
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

STARTS, ARRIVES, LONGEST = 0.1, 1.0, 100.0
"""Time runs from when it has moved this far [m], until it is this near its goal [m], or for so
long [s]."""
SPEED, LEAST, MOST = 2.0, 2.0, 8.0
"""The metric's ideal speed [m/s], and between which multiples of the ideal time a time counts."""

PUBLIC = 300
"""Worlds of the public set."""
PUBLISHED = """\
Published, in Gazebo with ROS and on other worlds, not to be compared with this kinematic replica:
  LiCS-KI 98.0 %, score 0.489, 7.7 s; DRL-VO 93.6 %, 0.371; DWA of move_base 85.0 %, 0.159;
  an NMPC with acados 0.4515 (2026, second-hand)"""
COLUMNS = (
    Column("drives", "d", len),
    Column("arrived", "d", count_of("arrived")),
    Column("hit", "d", count_of("collided")),
    Column("score", ".4f", mean_of("score")),
    Column("time", ".2f", lambda rows: mean_of("seconds")([r for r in rows if r.arrived])),
    Column("back", ".0%", mean_of("reverses")),
    Column("turn", ".0%", mean_of("turns")),
    Column("FALLBACK", ".1%", mean_of("fallback")),
    Column("FEASIBLE", ".1%", mean_of("feasible")),
    Column("jerk", ".3f", mean_of("jerk")),
    Column("p50", ".1f", mean_of("step_p50")),
    Column("p99 ms", ".1f", mean_of("step_p99")),
)


@dataclass(frozen=True)
class ClutterDrive:
    """What became of one drive."""

    axes: tuple[str, ...]
    """Condition and driver."""
    seed: str
    """Name of the world."""
    arrived: bool
    collided: bool
    seconds: float
    """As the challenge counts them [s]."""
    score: float
    clearance: float
    """Least one [m]."""
    reverses: float
    """Share of the steps with a command backwards."""
    turns: float
    """Share of the steps that turn on the spot."""
    fallback: float
    """Share of the steps without a verified plan, STOPPED or FALLBACK."""
    feasible: float
    jerk: float
    """RMS of the change of commands from step to step, as a share of the bounds."""
    step_p50: float
    """[ms]."""
    step_p99: float
    ended: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(self.axes))  # a record has a list


def world_of(seed: int, moving: bool, barn: str) -> Cylinders:
    """World of a seed, or of a number of the public set in a folder."""
    if barn:
        return read_barn(Path(barn), seed)
    return draw_moving(seed) if moving else draw_field(seed)


def drive(
    driver: str, condition: str, seed: int, moving: bool, barn: str, again: int
) -> ClutterDrive:
    """Drive one world with one driver; `again` is the seed of noise and slip."""
    world, given = world_of(seed, moving, barn), CONDITIONS[condition]
    ours = Ours(world, given) if driver == "ours" else None
    loop = ClutterLoop(ours or Theirs(driver, world), world, given, again)
    arrived, collided, seconds = loop.run()
    ideal = world.length / SPEED
    score = ideal / float(np.clip(seconds, LEAST * ideal, MOST * ideal)) if arrived else 0.0
    commands = np.array(loop.commands)
    statuses = ours.statuses if ours else []
    spots = (np.abs(commands[:, 0]) < 0.05) & (np.abs(commands[:, 1]) > 0.2)
    lost = sum(s in (PlanStatus.STOPPED, PlanStatus.FALLBACK) for s in statuses)
    p50, p99 = np.quantile(ours.times, (0.5, 0.99)) if ours else (math.nan, math.nan)
    return ClutterDrive(
        (condition, driver),
        *(world.name, arrived, collided, seconds, score, loop.clearance),
        reverses=float((commands[:, 0] < -0.02).mean()),
        turns=float(spots.mean()),
        fallback=lost / max(len(statuses), 1),
        feasible=statuses.count(PlanStatus.FEASIBLE) / max(len(statuses), 1),
        jerk=jerk(np.diff(commands, axis=0) / (JACKAL.speed, JACKAL.turn_rate)),
        step_p50=float(p50),
        step_p99=float(p99),
        ended=ours.ended if ours else "",
    )


class ClutterLoop:
    """One drive, from start to end.

    Parameters
    ----------
    driver : Driver
        What decides.
    world : Cylinders
        Where.
    condition : Condition
        How well it sees.
    seed : int
        Of noise and slip.
    """

    def __init__(self, driver: Driver, world: Cylinders, condition: Condition, seed: int) -> None:
        self.driver, self.world, self.condition = driver, world, condition
        self.random = np.random.default_rng([seed, 83])
        self.plant = RobotPlant(JACKAL, seed)
        self.pose: Array = world.start.copy()
        self.odometry: Array = world.start.copy()
        self.seen: list[tuple[Array, Array]] = []
        self.poses: list[Array] = [self.pose]
        self.commands: list[Array] = []
        self.clearance = math.inf

    def run(self) -> tuple[bool, bool, float]:
        """Drive; whether it arrived, whether it touched, and the time that counts [s]."""
        world, dt, begun, k = self.world, JACKAL.dt, math.inf, 0
        while True:
            time = k * dt
            self.seen.append((self._measured(), self._ranges(time)))
            late = self.seen[-1 - min(self.condition.late, k)]
            command = self.driver.command(*late)
            self.commands.append(command)
            self._move(command, time)
            k += 1
            if math.isinf(begun) and math.dist(self.pose[:2], world.start[:2]) > STARTS:
                begun = time
            seconds = k * dt - min(begun, k * dt)
            arrived = math.dist(self.pose[:2], world.goal[:2]) <= ARRIVES
            # a robot that never moves is not waited for, either
            over = seconds >= LONGEST or (math.isinf(begun) and k * dt >= LONGEST)
            if arrived or over or self.clearance < 0.0:
                return arrived and self.clearance >= 0.0, self.clearance < 0.0, seconds

    def _move(self, command: Array, time: float) -> None:
        """Drive for a period; look for touches, and count what is driven as odometry does."""
        poses = self.plant.drive(self.pose, command)
        for i, pose in enumerate(poses[1::2]):
            circles = self.world.circles_at(time + JACKAL.dt * (2 * i + 2) / len(poses))
            near = np.hypot(*(circles[:, :2] - pose[:2]).T) < 1.5
            gap = footprint_gaps(OUTLINE, pose[None], circles[None, near], ())
            self.clearance = min(self.clearance, float(gap[0]))
        step = poses[-1] - self.pose
        more = 1.0 + self.condition.drift
        off = self.odometry[2] - self.pose[2]
        cos, sin = math.cos(off), math.sin(off)
        along = more * np.array([cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]])
        self.odometry = self.odometry + np.array([*along, more * step[2]])
        self.pose = poses[-1]
        self.poses.append(self.pose)

    def _measured(self) -> Array:
        given = self.condition
        spread = np.array([given.place, given.place, given.heading])
        return self.odometry + spread * self.random.normal(size=3)

    def _ranges(self, time: float) -> Array:
        x, y, heading = self.pose
        origin = np.array([x + MOUNT * math.cos(heading), y + MOUNT * math.sin(heading)])
        circles = self.world.circles_at(time)
        near = np.hypot(*(circles[:, :2] - origin).T) < REACH + 1.0
        directions = heading + np.linspace(-0.5, 0.5, BEAMS) * VIEW
        ranges = World(circles[near]).ranges(origin, directions)
        ranges = ranges + self.condition.ranges * self.random.normal(size=BEAMS)
        return np.where(ranges > REACH, np.inf, np.maximum(ranges, 0.0))


def study(
    work: Work,
    seeds: Sequence[int],
    conditions: Sequence[str] = ("exact", "noisy"),
    drivers: Sequence[str] = DRIVERS,
    moving: bool = False,
    barn: str = "",
    repeats: int = 1,
) -> list[ClutterDrive]:
    """Drive every world with every driver; rows in the order of conditions, drivers, worlds."""
    again = range(repeats)
    wanted = [
        (driver, condition, seed, moving, barn, k)
        for condition, driver, seed, k in product(conditions, drivers, seeds, again)
    ]
    return work.rows("clutter", wanted, drive, ClutterDrive)


def format_rows(rows: Sequence[ClutterDrive], published: bool = True) -> str:
    """Table, every drive that did not arrive, and what others publish."""
    text = table(rows, COLUMNS, "world")
    return f"{text}\n{PUBLISHED}" if published else text
