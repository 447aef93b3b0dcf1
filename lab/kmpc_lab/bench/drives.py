"""Recorded drives, past circles or by lidar, that contenders plan from, and their model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec, scan_of, scan_ranges
from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lab.studies.any_robot import STANDARD, RobotPlant
from kmpc_lab.studies.contenders import DT, PAPER_FORM, Contender
from kmpc_lab.studies.sight import KINDS, SIDE, course_of
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.scene import Obstacles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.types import Array

TUNING_SEED, REPORTING_SEED = 7_000, 700_000
"""First seeds of the recorded drives: for finding settings, and for what is reported."""
STEPS, OBSTACLES = 60, 4  # states of a recorded drive, and circles that it leads past
SLIP = 0.05
HALF = 1.8  # starts and goals lie so far from the middle, at the most, along both axes [m]
SPACING = 0.45
"""Free space between obstacles, beyond their radii [m]: half as much again as the robot is wide."""
REACH = 4.0  # how far the scanner sees [m]
BEAMS = (360, 720, 1440)
SCANNED = 160  # of a drive at most: about half the way through one of the worlds
CIRCLES = 4
Step = tuple[Array, Array, Obstacles, Array | None]
"""Pose, goal, obstacles and command sent before of a recorded step."""


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """Recorded states (T, 3) of one drive, its goal (3,) and its obstacles (M, 5)."""

    states: Array
    goal: Array
    circles: Array


def learned_model() -> KoopmanModel:
    """Model of all contenders: an integral fit on a slipping floor, with midpoint steps."""
    data = generate_dataset(DifferentialDrive(SLIP, seed=1), episodes=100, steps=500, dt=DT, seed=2)
    return replace(fit(data), integrator="midpoint")


def _clearances(point: Array, circles: Array) -> Array:
    """Distances (M,) from a point to the edges of circles (M, 5) [m]; negative inside."""
    return np.asarray(np.hypot(*(point[:2] - circles[:, :2]).T) - circles[:, 2])


def random_circles(random: np.random.Generator, count: int) -> Array:
    """Obstacles (count, 5) with room between them, in an area that grows with their number."""
    half = 1.6 * max(1.0, np.sqrt(count / 6))
    placed: list[Array] = []
    while len(placed) < count:
        row = np.array([*random.uniform(-half, half, 2), random.uniform(0.10, 0.28), 0.0, 0.0])
        if (_clearances(row, np.array(placed).reshape(-1, 5)) > row[2] + SPACING).all():
            placed.append(row)
    return np.array(placed)


def free_pose(random: np.random.Generator, circles: Array) -> Array:
    """Pose (3,) at least 0.1 m clear of the obstacles."""
    while True:
        pose = np.array([*random.uniform(-HALF, HALF, 2), random.uniform(-np.pi, np.pi)])
        if (_clearances(pose, circles) > 0.25).all():
            return pose


def record(
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: int,
    seed: int,
    steps: int = STEPS,
    driver: Contender = PAPER_FORM,
) -> list[RecordedDrive]:
    """Drive random maps with one of our controllers, for states that all plan from."""
    recorded = []
    for i in range(drives):
        random = np.random.default_rng(seed + i)
        circles = random_circles(random, OBSTACLES)
        x, goal = free_pose(random, circles), free_pose(random, circles)
        controller = driver.make(model, problem, OBSTACLES)
        plant = DifferentialDrive(SLIP, seed=seed + i)
        states = [x]
        for _ in range(steps - 1):
            x = plant.step(x, controller.step(x, goal, circles).command, problem.dt)
            states.append(x)
        recorded.append(RecordedDrive(np.array(states), goal, circles))
    return recorded


@dataclass(frozen=True, eq=False)
class _Drive:
    """Where a drive leads, and what the robot knows or sees on it."""

    start: Array
    goal: Array
    obstacles: Callable[[Array], Obstacles]


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
    while len(recorded) < SCANNED:
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
