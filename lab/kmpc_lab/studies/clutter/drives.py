"""Drives through cylinders by lidar alone: a kinematic replica of the challenge, judged by truth.

The robot is Jackal-like and is learned from 180 s of its own log. As in the challenge the time of a
drive runs from when it has moved 0.1 m; it ends within a metre of the goal, by a touch or after
100 s, and the metric is the ideal time (the way at 2 m/s) over the time, which counts as at least
twice and at most eight times the ideal one: half a point at most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from typing import Protocol

import numpy as np

from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn
from kmpc_lab.studies.clutter.dwa import Dwa
from kmpc_lab.studies.clutter.worlds import Cylinders, draw_field, draw_moving, read_barn
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop, commanded
from kmpc_lab.studies.sight.pursuit import Pursuit
from kmpc_lab.studies.table import DRIVES, FEASIBLE, JERK, LOST, SECONDS, Column, mean_of
from kmpc_lite.control import Controller, ControllerOptions, Footprint, LaserScan
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.plan import Plan
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

SIZE = (0.51, 0.43)
"""Length and width [m]."""
OUTLINE = Footprint.rectangle(*SIZE)
JACKAL = Robot(
    "Jackal",
    0.5 * math.hypot(*SIZE),
    2.0,
    4.0,
    dt=0.05,
    lag=0.06,
    ramps=(2.0 / 4.9, 2.0 / 4.9),
    slip=0.03,
    seconds=180.0,
    footprint=OUTLINE,
)
"""Changes its speed by 4.9 m/s^2 and its turn rate by 9.8 rad/s^2."""
LOG_SEED = 31
"""Of the log that it is learned from."""
BEAMS, VIEW, REACH, MOUNT = 720, 1.5 * math.pi, 10.0, 0.055
"""Of its lidar: beams, field of view [rad], reach, and how far ahead it sits [m]."""
FREE = 3.0
"""How far around it there is nothing where it begins [radii]: a metre."""
PURSUES = 1.0
"""Speed of pure pursuit [m/s]: it knows of no braking."""
STARTS, ARRIVES, LONGEST = 0.1, 1.0, 100.0
"""Time runs from when it has moved this far [m], until it is this near its goal [m], or for so
long [s]."""
SPEED, LEAST, MOST = 2.0, 2.0, 8.0
"""The metric's ideal speed [m/s], and between which multiples of the ideal time a time counts."""
COLUMNS = (
    *DRIVES,
    Column("score", ".4f", mean_of("score")),
    SECONDS,
    Column("back", ".0%", mean_of("reverses")),
    Column("turn", ".0%", mean_of("turns")),
    LOST,
    FEASIBLE,
    JERK,
    Column("p50", ".1f", mean_of("step_p50")),
    Column("p99 ms", ".1f", mean_of("step_p99")),
)
"""Back and turn: shares of the steps with a command backwards, and of those on the spot."""


@dataclass(frozen=True)
class Condition:
    """How well poses and ranges are measured."""

    place: float
    """Standard deviation of a pose [m]."""
    heading: float
    """Of its heading [rad]."""
    ranges: float
    """Of a range [m]."""
    late: int = 0
    """Age of poses and scans, which no driver knows [periods]."""
    drift: float = 0.0
    """Share by which odometry counts too much of what is driven and turned."""


CONDITIONS = {
    "exact": Condition(0.002, math.radians(0.1), 0.001),
    "noisy": Condition(0.01, math.radians(0.5), 0.01),
    "late": Condition(0.002, math.radians(0.1), 0.001, late=1, drift=0.015),
}
"""``exact``: as in Gazebo; ``noisy``: 1 cm, 0.5 degrees; ``late``: exact, but one period of age
that no driver knows, and odometry that drifts by 1.5 %."""


class Driver(Protocol):
    """Decides by what is measured."""

    def plan(self, pose: Array, ranges: Array) -> Plan:
        """Plan from a pose (3,) and ranges (BEAMS,)."""


class Ours:
    """The controller, with scans alone."""

    def __init__(self, world: Cylinders, condition: Condition) -> None:
        x1, y1, x2, y2 = world.bounds
        problem = replace(
            JACKAL.problem(1.0), x_min=(x1, y1, -np.inf), x_max=(x2, y2, np.inf), sensor_range=REACH
        )
        model = model_of(condition.place, condition.heading)
        options = ControllerOptions(sight=SightOptions(free_at_start=FREE))
        # what other work on the machine takes does not count
        self.controller = Controller(model, problem, options=options, clock=process_time)
        self.goal, self.noise = world.goal, condition.ranges

    def plan(self, pose: Array, ranges: Array) -> Plan:
        """Plan."""
        step, mount = VIEW / (BEAMS - 1), (MOUNT, 0.0, 0.0)
        scan = LaserScan(ranges, -0.5 * VIEW, step, REACH, 0.05, mount, noise=self.noise)
        return self.controller.step(pose, self.goal, [scan])


class Theirs:
    """Pure pursuit, or the dynamic window, of the points that beams hit."""

    def __init__(self, name: str, world: Cylinders) -> None:
        x1, y1, x2, y2 = world.bounds
        fastest = (JACKAL.speed, JACKAL.turn_rate)
        self.middle, self.goal = np.zeros(3), world.goal
        if name == "dwa":
            ramps = (fastest[0] / JACKAL.ramps[0], fastest[1] / JACKAL.ramps[0])
            self.drives = Dwa(world.bounds, SIZE, fastest, ramps, JACKAL.dt).command
        else:
            # its area is a square about the origin; its circle turns within the outline's
            self.middle = np.array([0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.0])
            pursuit = Pursuit(0.29, PURSUES, 2.0, max(x2 - x1, y2 - y1))
            self.drives = lambda pose, goal, ends: pursuit.command(pose, goal, ends, 0.1)

    def plan(self, pose: Array, ranges: Array) -> Plan:
        """Decide."""
        hit = np.isfinite(ranges)
        along = pose[2] + np.linspace(-0.5, 0.5, BEAMS)[hit] * VIEW
        origin = pose[:2] + MOUNT * np.array([math.cos(pose[2]), math.sin(pose[2])])
        ends = origin + ranges[hit, None] * np.stack([np.cos(along), np.sin(along)], axis=1)
        middle = self.middle
        return commanded(self.drives(pose - middle, self.goal - middle, ends - middle[:2]))


@cache
def model_of(place: float, heading: float) -> KoopmanModel:
    """Learn the robot from its log, measured as well as when it drives."""
    return learn(replace(JACKAL, noise=(place, heading)), LOG_SEED)


def world_of(kind: str, seed: int) -> Cylinders:
    """World of a seed, or of a number of the public set: ``barn:FOLDER``."""
    name, _, folder = kind.partition(":")
    if name == "barn":
        return read_barn(Path(folder), seed)
    return draw_moving(seed) if name == "moving" else draw_field(seed)


def drive(kind: str, condition: str, driver: str, seed: int) -> DriveResult:
    """Drive one world with one driver; the seed is of world, noise and slip."""
    return judge(driver, world_of(kind, seed), CONDITIONS[condition], seed)


def judge(name: str, world: Cylinders, given: Condition, seed: int) -> DriveResult:
    """Drive a world, and judge as the challenge does."""
    driver: Driver = Ours(world, given) if name == "ours" else Theirs(name, world)
    eyes = _Eyes(driver, world, given, seed)
    goal, full = world.goal[:2], np.array((JACKAL.speed, JACKAL.turn_rate))
    ideal = world.length / SPEED
    task = Task(
        world.start,
        world.goal,
        lambda pose: math.dist(pose[:2], goal) <= ARRIVES,
        eyes.gaps,
        ideal,
        LONGEST,
        full,
        JACKAL.dt,
        held=0.0,
        body=OUTLINE,
        around=[World(world.circles_at(0.0))],
    )
    row = closed_loop(eyes.step, eyes.move, task)
    assert row.trace is not None
    poses, commands = row.trace[:2]
    moved = np.hypot(*(poses[1:, :2] - world.start[:2]).T) > STARTS
    seconds = row.seconds - JACKAL.dt * float(np.argmax(moved) if moved.any() else len(moved))
    score = ideal / float(np.clip(seconds, LEAST * ideal, MOST * ideal)) if row.arrived else 0.0
    spots = (np.abs(commands[:, 0]) < 0.05) & (np.abs(commands[:, 1]) > 0.2)
    more = {
        "score": score,
        "reverses": float((commands[:, 0] < -0.02).mean()),
        "turns": float(spots.mean()),
    }
    return replace(row, seconds=seconds, peer=name != "ours", more=more)


class _Eyes:
    """What is measured and what moves, in one drive."""

    def __init__(self, driver: Driver, world: Cylinders, condition: Condition, seed: int) -> None:
        self.driver, self.world, self.condition = driver, world, condition
        self.random, self.plant = np.random.default_rng([seed, 83]), RobotPlant(JACKAL, seed)
        self.odometry, self.time = world.start.copy(), 0.0
        self.seen: list[tuple[Array, Array]] = []

    def step(self, pose: Array, number: int) -> Plan:
        """Measure, and decide by what was measured, perhaps a period ago."""
        given = self.condition
        spread = np.array([given.place, given.place, given.heading])
        measured = self.odometry + spread * self.random.normal(size=3)
        self.seen.append((measured, self._ranges(pose)))
        return self.driver.plan(*self.seen[-1 - min(given.late, number)])

    def move(self, pose: Array, command: Array) -> Array:
        """Drive for a period, and count what is driven as odometry does."""
        poses = self.plant.drive(pose, command)
        step, off = poses[-1] - pose, self.odometry[2] - pose[2]
        cos, sin = math.cos(off), math.sin(off)
        along = cos * step[0] - sin * step[1], sin * step[0] + cos * step[1]
        self.odometry = self.odometry + (1.0 + self.condition.drift) * np.array([*along, step[2]])
        return poses

    def gaps(self, poses: Array) -> Array:
        """Distances (n,) of the outline from cylinders in the period in which it is asked."""
        dt, found = JACKAL.dt / len(poses), []
        for i, pose in enumerate(poses[1::2]):
            circles = self.world.circles_at(self.time + dt * (2 * i + 2))
            near = np.hypot(*(circles[:, :2] - pose[:2]).T) < 1.5
            found.append(footprint_gaps(OUTLINE, pose[None], circles[None, near], ()))
        self.time += JACKAL.dt
        out: Array = np.concatenate(found)
        return out

    def _ranges(self, pose: Array) -> Array:
        x, y, heading = pose
        origin = np.array([x + MOUNT * math.cos(heading), y + MOUNT * math.sin(heading)])
        circles = self.world.circles_at(self.time)
        near = np.hypot(*(circles[:, :2] - origin).T) < REACH + 1.0
        directions = heading + np.linspace(-0.5, 0.5, BEAMS) * VIEW
        ranges = World(circles[near]).ranges(origin, directions)
        ranges = ranges + self.condition.ranges * self.random.normal(size=BEAMS)
        return np.where(ranges > REACH, np.inf, np.maximum(ranges, 0.0))
