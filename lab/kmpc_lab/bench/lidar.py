"""Recorded drives by lidar, and past four known circles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kmpc_lab.bench.drives import free_pose, random_circles
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
Step = tuple[Array, Array, Obstacles, Array | None]
"""Pose, goal, obstacles and command sent before of a recorded step."""


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
