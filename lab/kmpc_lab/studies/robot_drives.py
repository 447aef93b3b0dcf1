"""Drives of robots that the controller was not tuned for, over random maps of their sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies import drive_results
from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn, random_robot
from kmpc_lab.studies.any_wheels import CarRobot, Moves, OmniRobot, draw_car, draw_omni
from kmpc_lab.studies.drive_results import Column, DriveResult, circle_gaps, closed_loop, count_of
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Circle, Controller
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.types import Array

COLUMNS = (
    *drive_results.DRIVES,
    Column("held elsewhere", "d", count_of("held_elsewhere")),
    drive_results.TIME,
    drive_results.STOPPED,
)


@dataclass(frozen=True)
class Course:
    """A map of a robot's size, with what is measured of the robot."""

    start: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    circles: list[Circle]
    side: float
    """Side of the area [m]."""
    spread: Array
    """Standard deviations of a measured pose, (3,) [m, m, rad]."""
    ideal: float
    """Least time, obstacles aside [s]."""


def course_of(robot: Robot | CarRobot | OmniRobot, seed: int, family: str = "open") -> Course:
    """Give a random map the size of a robot."""
    scenario, by = random_map(family, seed), robot.radius / UNIT_RADIUS
    unit = np.array((by, by, 1.0))
    start, goal = np.array(scenario.start) * unit, np.array(scenario.goal) * unit
    return Course(
        start,
        goal,
        [Circle(by * c.x, by * c.y, by * c.radius, 0.0, 0.0) for c in scenario.circles],
        by * (scenario.bounds[2] - scenario.bounds[0]),
        np.array((robot.noise[0], robot.noise[0], robot.noise[1])),
        robot.ideal(start, goal),
    )


def drive(
    robot: Robot, seed: int, family: str = "open", model: KoopmanModel | None = None
) -> DriveResult:
    """Learn a robot and drive it over one random map of its size."""
    model = learn(robot, seed) if model is None else model
    course = course_of(robot, seed, family)
    controller = Controller(model, robot.problem(course.side))
    return judge(robot.name, seed, controller, RobotPlant(robot, seed), course)


def drive_wheels(robot: CarRobot | OmniRobot, seed: int) -> DriveResult:
    """Learn a car or an omni from its own log and drive it over one random map of its size."""
    course = course_of(robot, seed)
    ready, half = robot.ready(seed), 0.5 * course.side
    area = np.array((half, half, np.inf))
    problem = replace(ready.problem, x_min=-area, x_max=area)
    return judge(robot.name, seed, Controller(ready.model, problem), ready.plant, course)


def judge(
    name: str, seed: int, controller: Controller, plant: Moves, course: Course
) -> DriveResult:
    """Drive over a course, and judge by the true poses."""
    task = drive_results.Drive(
        course.start,
        course.goal,
        course.ideal,
        8.0 * course.ideal + 20.0,
        lambda pose: course.circles,
        circle_gaps(controller.problem, course.circles),
        course.spread,
    )
    return closed_loop((name,), seed, controller, plant.drive, task)


def drive_random(seed: int, shapes: bool = True, wheels: str = "differential") -> DriveResult:
    """Draw a robot, learn it and drive it; `shapes`: whether it may be one that is not round."""
    if wheels != "differential":
        return drive_wheels(_drawn(wheels, seed), seed)
    robot = random_robot(seed, shapes)
    name = "any robot" if robot.footprint is None else "not round"
    return replace(drive(robot, seed), axes=(name,))


def _drawn(wheels: str, seed: int) -> CarRobot | OmniRobot:
    """Draw a robot on other wheels, or one of the digital twin."""
    if wheels in ("twin-car", "twin-omni"):
        from kmpc_lab.studies import any_twin  # needs MuJoCo

        return (any_twin.twin_car if wheels == "twin-car" else any_twin.twin_omni)(seed)
    return (draw_car if wheels == "car" else draw_omni)(seed)


def study(
    name: str, robots: Sequence[Robot], seeds: Sequence[int], work: Work
) -> list[DriveResult]:
    """Drive every robot over the maps of all seeds; rows in this order.

    Seeds are those of maps, slip and noise; a robot that is learned is learned anew for each.
    """
    one = partial(_drive_named, {robot.name: robot for robot in robots})
    wanted = product([robot.name for robot in robots], seeds)
    return work.rows(name, wanted, one, DriveResult)


def _drive_named(robots: dict[str, Robot], name: str, seed: int) -> DriveResult:
    return drive(robots[name], seed)


def study_random(
    seeds: Sequence[int], shapes: bool, wheels: Sequence[str], work: Work
) -> list[DriveResult]:
    """Drive a robot drawn at random for each seed; `shapes` and `wheels` as for `drive_random`."""
    wanted = ((seed, shapes, kind) for kind in wheels for seed in seeds)
    return work.rows("anyrobot", wanted, drive_random, DriveResult)


def format_rows(rows: Sequence[DriveResult]) -> str:
    """Table with a row a robot, then every drive that did not end in pose."""
    return drive_results.table(rows, COLUMNS, "map")
