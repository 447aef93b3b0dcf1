"""Drives of robots that the controller was not tuned for: judged by the truth, counted, and listed.

In pose means within `in_pose` by the true pose, held for a second. A collision is an overlap of
outlines at any of ten looks a period; the account of it shares no code with the controller.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, Protocol

import numpy as np

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.sim.periods import periods
from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn, random_robot
from kmpc_lab.studies.any_wheels import CarRobot, Moves, OmniRobot, draw_car, draw_omni
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Circle, Controller, NavigationProblem
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.scenario.arrival import in_pose
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.types import Array

HELD = 1.0
"""How long the robot must hold its goal [s]."""


@dataclass(frozen=True)
class RobotDrive:
    """What became of one drive."""

    robot: str
    seed: int
    in_pose: bool
    held_elsewhere: bool
    collided: bool
    seconds: float
    ideal_seconds: float
    clearance: float
    stopped: float
    """Share of steps without a plan."""
    ended: str
    """Progress that was reported at the end, and its reason."""


class Sized(Protocol):
    """A robot, as a map of its size needs it."""

    @property
    def radius(self) -> float:
        """Radius [m]."""
        ...

    @property
    def noise(self) -> tuple[float, float]:
        """Standard deviation of a measured pose [m, rad]."""
        ...

    def ideal(self, start: Array, goal: Array) -> float:
        """Least time between two poses, obstacles aside [s]."""
        ...


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


def course_of(robot: Sized, seed: int, family: str = "open") -> Course:
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
) -> RobotDrive:
    """Learn a robot and drive it over one random map of its size."""
    model = learn(robot, seed) if model is None else model
    course = course_of(robot, seed, family)
    controller = Controller(model, robot.problem(course.side))
    return judge(robot.name, seed, controller, RobotPlant(robot, seed), course)


def drive_wheels(robot: CarRobot | OmniRobot, seed: int) -> RobotDrive:
    """Learn a car or an omni from its own log and drive it over one random map of its size."""
    course = course_of(robot, seed)
    ready, half = robot.ready(seed), 0.5 * course.side
    area = np.array((half, half, np.inf))
    problem = replace(ready.problem, x_min=-area, x_max=area)
    return judge(robot.name, seed, Controller(ready.model, problem), ready.plant, course)


def judge(name: str, seed: int, controller: Controller, plant: Moves, course: Course) -> RobotDrive:
    """Drive over a course, and judge by the true poses."""
    radius, dt = controller.problem.body_radius, controller.problem.dt
    random, goal = np.random.default_rng([seed, 7]), course.goal
    tolerance = in_pose(radius, course.spread)
    inside, stopped, clearance = 0.0, 0, np.inf

    def step(pose: Array, k: int) -> Plan:
        measured = pose + course.spread * random.normal(size=3)
        return controller.step(measured, goal, course.circles)

    most = math.ceil((8.0 * course.ideal + 20.0) / dt)
    for period in periods(step, plant.drive, course.start, most):
        plan, poses = period.plan, period.poses
        stopped += plan.status is PlanStatus.STOPPED
        clearance = min(clearance, _least_gap(controller.problem, poses, course.circles))
        if clearance < 0.0:
            break
        inside = inside + dt if tolerance.met(poses[-1], goal) else 0.0
        if inside >= HELD:
            break
    driven = period.number + 1
    return RobotDrive(
        name,
        seed,
        inside >= HELD,
        plan.holding and inside < HELD,
        clearance < 0.0,
        driven * dt - HELD,
        course.ideal,
        clearance,
        stopped / driven,
        f"{plan.progress.value}: {plan.reason}" if plan.reason else plan.progress.value,
    )


def _least_gap(problem: NavigationProblem, poses: Array, circles: Sequence[Circle]) -> float:
    """Least distance between a robot at poses (n, 3) and circles at rest [m]; of the outline."""
    if problem.footprint is not None:
        rows = np.tile(np.array(circles).reshape(1, -1, 5), (len(poses), 1, 1))
        return float(footprint_gaps(problem.footprint, poses, rows, ()).min())
    least = np.inf
    for circle in circles:
        away = np.hypot(poses[:, 0] - circle.x, poses[:, 1] - circle.y)
        least = min(least, float(away.min()) - circle.radius - problem.robot_radius)
    return least


def drive_random(seed: int, shapes: bool = True, wheels: str = "differential") -> RobotDrive:
    """Draw a robot, learn it and drive it; `shapes`: whether it may be one that is not round."""
    if wheels != "differential":
        return drive_wheels(_drawn(wheels, seed), seed)
    robot = random_robot(seed, shapes)
    name = "any robot" if robot.footprint is None else "not round"
    return replace(drive(robot, seed), robot=name)


def _drawn(wheels: str, seed: int) -> CarRobot | OmniRobot:
    """Draw a robot on other wheels, or one of the digital twin."""
    if wheels in ("twin-car", "twin-omni"):
        from kmpc_lab.studies import any_twin  # needs MuJoCo

        return (any_twin.twin_car if wheels == "twin-car" else any_twin.twin_omni)(seed)
    return (draw_car if wheels == "car" else draw_omni)(seed)


def summary(rows: Sequence[RobotDrive]) -> dict[str, Any]:
    """Counts of one robot's, or one study's, drives."""
    times = [r.seconds / r.ideal_seconds for r in rows if r.in_pose]
    return {
        "drives": len(rows),
        "in_pose": sum(r.in_pose for r in rows),
        "collisions": sum(r.collided for r in rows),
        "held_elsewhere": sum(r.held_elsewhere for r in rows),
        "time_to_ideal": float(np.median(times)) if times else math.nan,
        "stopped": float(np.mean([r.stopped for r in rows])),
    }


def study(name: str, robots: Sequence[Robot], seeds: Sequence[int], work: Work) -> list[RobotDrive]:
    """Drive every robot over the maps of all seeds; rows in this order.

    Seeds are those of maps, slip and noise; a robot that is learned is learned anew for each.
    """
    one = partial(_drive_named, {robot.name: robot for robot in robots})
    wanted = product([robot.name for robot in robots], seeds)
    return work.rows(name, wanted, one, RobotDrive)


def _drive_named(robots: dict[str, Robot], name: str, seed: int) -> RobotDrive:
    return drive(robots[name], seed)


def study_random(
    seeds: Sequence[int], shapes: bool, wheels: Sequence[str], work: Work
) -> list[RobotDrive]:
    """Drive a robot drawn at random for each seed; `shapes` and `wheels` as for `drive_random`."""
    wanted = ((seed, shapes, kind) for kind in wheels for seed in seeds)
    return work.rows("anyrobot", wanted, drive_random, RobotDrive)


def format_rows(rows: Sequence[RobotDrive]) -> str:
    """Table with a row a robot, then every drive that did not end in pose."""
    names = list(dict.fromkeys(row.robot for row in rows))
    lines = [f"{'':16} drives  in pose  collisions  held elsewhere  time to ideal  stopped"]
    for name in names:
        s = summary([row for row in rows if row.robot == name])
        lines.append(
            f"{name:16} {s['drives']:6d} {s['in_pose']:8d} {s['collisions']:11d} "
            f"{s['held_elsewhere']:15d} {s['time_to_ideal']:14.2f} {100 * s['stopped']:7.1f} %"
        )
    lines += [
        f"{row.robot}, map {row.seed}: {'touched' if row.collided else row.ended}"
        for row in rows
        if row.collided or not row.in_pose
    ]
    return "\n".join(lines)
