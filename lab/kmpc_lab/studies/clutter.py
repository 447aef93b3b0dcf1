"""Drives through cylinders by lidar alone: a kinematic replica of the challenge, judged by truth.

The field is drawn as Perille et al. publish it ("Benchmarking Metric Ground Navigation", 2020):
30 x 30 cells of 0.15 m, 15 to 30 % filled, two to four rounds of smoothing (five filled neighbours
fill a cell, at most one clears it), walls of cylinders along both sides, and none that has no way
through. The moving cylinders follow Nair et al. ("DynaBARN", 2022): curves across a square, at a
speed that changes from leg to leg.

The robot is Jackal-like and is learned from 180 s of its own log. As in the challenge the time of a
drive runs from when it has moved 0.1 m; it ends within a metre of the goal, by a touch or after
100 s, and the metric is the ideal time (the way at 2 m/s) over the time, which counts as at least
twice and at most eight times the ideal one: half a point at most.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from typing import Protocol

import numpy as np
from scipy import ndimage

from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop, commanded
from kmpc_lab.studies.dwa import Dwa
from kmpc_lab.studies.pursuit import cost_to_go
from kmpc_lab.studies.table import DRIVES, FEASIBLE, JERK, LOST, SECONDS, Column, mean_of
from kmpc_lite.control import Controller, ControllerOptions, Footprint, LaserScan
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.plan import Plan
from kmpc_lite.errors import DataError
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

CELL = 0.15  # diameter of a cylinder, and side of a cell [m]
ROWS = 30  # cells along each side of the field
FILLS, SMOOTHINGS = (0.15, 0.20, 0.25, 0.30), (2, 3, 4)
"""Parameters of the twelve kinds of field; the public set has 25 of each."""
YARD = 5.0  # length of the free yard before the field [m]
PASSAGE = 0.34
"""Distance between the robot's middle and cylinders that a way through keeps [m]: it may turn on
the spot anywhere."""
GRID = 0.05  # side of the cells on which a way through is looked for [m]
ATTEMPTS = 3000
QUARTER = 0.5 * math.pi
SQUARE = 10.0  # half of the side of the square in which cylinders move [m]
MOVING_RADIUS = 0.5  # of a moving cylinder [m]
LEVELS = ((8, (0.3, 0.7), 1), (12, (0.4, 1.0), 2), (16, (0.5, 1.5), 3))
"""Easy, medium, hard: how many, their speeds [m/s], and the order of their curves."""
SIZE = (0.51, 0.43)  # length and width [m]
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
LOG_SEED = 31  # of the log that it is learned from
BEAMS, VIEW, REACH, MOUNT = 720, 1.5 * math.pi, 10.0, 0.055
"""Of its lidar: beams, field of view [rad], reach, and how far ahead it sits [m]."""
FREE = 3.0  # how far around it there is nothing where it begins [radii]: a metre
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
class Cylinders:
    """A world, where from and where to."""

    name: str
    ways: tuple[Array, ...]
    """Of each cylinder (K, 3) rows time, x, y [s, m], driven again and again; one row: at rest."""
    radius: float  # of every cylinder [m]
    start: Array  # (3,)
    goal: Array  # (3,)
    bounds: tuple[float, float, float, float]  # xmin, ymin, xmax, ymax of the area [m]
    length: float  # of the way that the metric reckons with [m]

    def circles_at(self, time: float) -> Array:
        """Rows x, y, radius, vx, vy (M, 5) at a time [s]."""
        rows = np.zeros((len(self.ways), 5))
        rows[:, 2] = self.radius
        if len(self.ways[0]) == 1:
            rows[:, :2] = np.concatenate(self.ways)[:, 1:]
            return rows
        for row, way in zip(rows, self.ways, strict=True):
            at = time % way[-1, 0]
            leg = min(int(np.searchsorted(way[:, 0], at, "right")), len(way) - 1)
            velocity = (way[leg, 1:] - way[leg - 1, 1:]) / (way[leg, 0] - way[leg - 1, 0])
            row[:2] = way[leg - 1, 1:] + (at - way[leg - 1, 0]) * velocity
            row[3:] = velocity
        return rows


def draw_field(seed: int) -> Cylinders:
    """Draw the field of a seed: one of the twelve kinds in turn, with a way through."""
    kind = seed % (len(FILLS) * len(SMOOTHINGS))
    fill, rounds = FILLS[kind // len(SMOOTHINGS)], SMOOTHINGS[kind % len(SMOOTHINGS)]
    random = np.random.default_rng([seed, 73])
    for _ in range(ATTEMPTS):
        world = of_places(f"field {seed}", _places(_automaton(random, fill, rounds)))
        if world is not None:
            return world
    raise DataError(f"no field of seed {seed} has a way through")


def _automaton(random: np.random.Generator, fill: float, rounds: int) -> Array:
    """Filled cells (ROWS, ROWS) along y and x; the first and last column are walls."""
    filled = random.random((ROWS, ROWS)) < fill
    filled[:, [0, -1]] = True
    around = np.ones((3, 3), dtype=int)
    around[1, 1] = 0
    for _ in range(rounds):
        # beyond the walls all is filled; before and behind the field nothing is
        padded = np.pad(filled, ((0, 0), (1, 1)), constant_values=True).astype(int)
        near = ndimage.convolve(padded, around, mode="constant")[:, 1:-1]
        filled = (near >= 5) | (filled & (near > 1))
    return filled


def _places(filled: Array) -> Array:
    """Middles (M, 2) of cylinders: the field's, and the walls of the yard before it."""
    side = ROWS * CELL
    along = np.arange(0.5 * CELL, YARD, CELL)
    across = np.arange(-side - 0.5 * CELL, 0.0, CELL)
    row, column = np.nonzero(filled)
    return np.concatenate(
        [
            np.stack([across, np.full(len(across), 0.5 * CELL)], axis=1),
            *(np.stack([np.full(len(along), x), along], 1) for x in (across[0], across[-1])),
            np.stack([across[0] + CELL * column, along[-1] + CELL * (row + 1)], axis=1),
        ]
    )


def of_places(name: str, places: Array, length: float = 0.0) -> Cylinders | None:
    """The course of the challenge through cylinders (M, 2); None if there is no way through.

    A length of 0 stands for that of the shortest way through.
    """
    start, goal = np.array([-2.25, 3.0, QUARTER]), np.array([-2.25, 13.0, QUARTER])
    bounds = (-6.75, 0.0, 2.25, 15.0)
    low, cells = np.array(bounds[:2]), (np.array(bounds[2:]) - bounds[:2]) / GRID
    hits = np.zeros((round(cells[1]), round(cells[0])), dtype=bool)
    column, row = np.floor((places - low) / GRID).astype(int).T
    hits[row, column] = True
    # middles of cylinders are middles of cells: the distances are exact
    free = ndimage.distance_transform_edt(~hits) * GRID - 0.5 * CELL >= PASSAGE
    begin, end = (
        tuple(np.floor((pose[1::-1] - low[::-1]) / GRID).astype(int)) for pose in (start, goal)
    )
    parts, _ = ndimage.label(free, np.ones((3, 3)))
    if not parts[begin] or parts[begin] != parts[end]:
        return None
    shortest = GRID * float(cost_to_go(free, end)[begin])
    ways = tuple(np.array([[0.0, *place]]) for place in places)
    return Cylinders(name, ways, 0.5 * CELL, start, goal, bounds, length or shortest)


def read_barn(folder: Path, number: int) -> Cylinders:
    """Read ``world_N.world`` of the public set, and ``path_N.npy`` where it is there.

    `folder`: holds the worlds, or the folder ``world_files`` of them; paths beside them or in
    ``path_files``. `number`: of the world. Raises DataError: names the file, what was expected and
    what came.
    """
    file = _found(folder, "world_files", f"world_{number}.world")
    if file is None:
        raise DataError(f"{folder}: expected world_{number}.world, found no such file")
    text = file.read_text(encoding="utf-8", errors="replace").split("<state", 1)[0]
    pattern = r"<model name='unit_cylinder_\d+'>.*?<pose[^>]*>\s*(\S+)\s+(\S+)\s"
    try:
        places = np.array(re.findall(pattern, text, re.DOTALL), dtype=float).reshape(-1, 2)
    except ValueError as error:
        raise DataError(f"{file}: expected poses of cylinders in numbers, got {error}") from error
    if not len(places):
        raise DataError(f"{file}: expected models named unit_cylinder_N, got none")
    if not (np.isfinite(places).all() and (places[:, 0] > -6.75).all()):
        raise DataError(f"{file}: expected cylinders within the challenge's area")
    path, length = _found(folder, "path_files", f"path_{number}.npy"), 0.0
    if path is not None:
        steps = np.load(path, allow_pickle=False) * CELL + (-4.575, YARD + 0.5 * CELL)
        points = np.concatenate([[(-2.25, 3.0)], steps, [(-2.25, 13.0)]])
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    world = of_places(f"BARN {number}", places, length)
    if world is None:
        raise DataError(f"{file}: expected a way through for the robot, found none")
    return world


def _found(folder: Path, inner: str, name: str) -> Path | None:
    places = folder / name, folder / inner / name, folder.parent / inner / name
    return next((place for place in places if place.is_file()), None)


def draw_moving(seed: int) -> Cylinders:
    """Draw cylinders that cross a square, and a robot that crosses it, too."""
    count, speeds, order = LEVELS[seed % len(LEVELS)]
    random = np.random.default_rng([seed, 79])
    start, goal = np.array([11.0, 0.0, math.pi]), np.array([-9.0, 0.0, math.pi])
    ways: list[Array] = []
    while len(ways) < count:
        way = _curve(random, speeds, order)
        # none begins within reach of where the robot stands
        begins = np.hypot(way[:, 1] - start[0], way[:, 2] - start[1])
        if begins[:2].min() > 3.0:
            ways.append(way)
    bounds = (-12.0, -12.0, 13.0, 12.0)
    return Cylinders(f"moving {seed}", tuple(ways), MOVING_RADIUS, start, goal, bounds, 20.0)


def _curve(random: np.random.Generator, speeds: tuple[float, float], order: int) -> Array:
    """Rows time, x, y (K, 3) to and fro on a polynomial across the square."""
    places = random.uniform(-SQUARE, SQUARE, (2, order + 1))
    places[0] = np.linspace(-SQUARE, SQUARE, order + 1)
    at = np.linspace(-SQUARE, SQUARE, 12)
    curve = np.polynomial.Polynomial.fit(places[0], places[1], order)
    across = np.clip(curve(at), -SQUARE, SQUARE)
    points = np.stack([at, across], axis=1)[:, :: int(random.choice([-1, 1]))]
    if random.random() < 0.5:
        points = points[::-1]
    points = np.concatenate([points, points[-2::-1]])
    legs = np.hypot(*np.diff(points, axis=0).T) / random.uniform(*speeds, len(points) - 1)
    times = np.concatenate([[0.0], np.cumsum(legs)])
    return np.column_stack([times, points])


@dataclass(frozen=True)
class Condition:
    """How well poses and ranges are measured."""

    place: float  # standard deviation of a pose [m]
    heading: float  # of its heading [rad]
    ranges: float  # of a range [m]
    late: int = 0  # age of poses and scans, which no driver knows [periods]
    drift: float = 0.0  # share by which odometry counts too much of what is driven and turned


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
    """The dynamic window, of the points that beams hit."""

    def __init__(self, world: Cylinders) -> None:
        fastest = (JACKAL.speed, JACKAL.turn_rate)
        ramps = (fastest[0] / JACKAL.ramps[0], fastest[1] / JACKAL.ramps[0])
        self.goal, self.drives = world.goal, Dwa(world.bounds, SIZE, fastest, ramps, JACKAL.dt)

    def plan(self, pose: Array, ranges: Array) -> Plan:
        """Decide."""
        hit = np.isfinite(ranges)
        along = pose[2] + np.linspace(-0.5, 0.5, BEAMS)[hit] * VIEW
        origin = pose[:2] + MOUNT * np.array([math.cos(pose[2]), math.sin(pose[2])])
        ends = origin + ranges[hit, None] * np.stack([np.cos(along), np.sin(along)], axis=1)
        return commanded(self.drives.command(pose, self.goal, ends))


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
    driver: Driver = Ours(world, given) if name == "ours" else Theirs(world)
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
