"""Drives by lidar alone, judged by the truth and by a ray caster of their own.

Arrived means within 0.15 radii and 0.1 rad by the true pose, held for half a second: wider than
where robots of any size are in pose (`in_pose`), since pursuit turns on the spot as soon as it is
within a tenth of the radius, and may slip out of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec, scan_of, scan_ranges
from kmpc_lab.studies.any_robot import KNOWN, STANDARD, Robot, RobotPlant, learn
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop, commanded
from kmpc_lab.studies.sight.pursuit import Pursuit
from kmpc_lab.studies.sight.seen_cells import SeenCells
from kmpc_lab.studies.sight.worlds import Course, course_of
from kmpc_lab.studies.table import DRIVES, SECONDS, STOPPED, Column, Rows, mean_of, median_of
from kmpc_lite.control import Controller
from kmpc_lite.control.plan import GoalProgress, Plan
from kmpc_lite.scenario.arrival import Tolerance
from kmpc_lite.types import Array

ROBOTS: dict[str, Robot] = {"standard": STANDARD, KNOWN[0].name: KNOWN[0]}
NEAR, TURNED = 0.15, 0.1
"""Tolerances of arrival [radii, rad]."""
TURNS_WITHIN = 0.1
"""How near its goal pursuit turns on the spot [radii]."""
HELD = 0.5
"""How long the goal must be held [s]."""
LONGEST = 8.0
"""Drives end after this many times the time of the straight line, and 40 s."""
BACK = 0.2
"""How far a robot must drive back for a change of gear [radii]: less is a turn on the spot."""


def total(name: str) -> Callable[[Rows], float]:
    """Sum of what a study tells more."""
    return lambda rows: sum(row.more[name] for row in rows)


COLUMNS = (
    *DRIVES,
    SECONDS,
    Column("gears", ".1f", median_of("gears")),
    STOPPED,
    Column("unseen", ".0f", total("unseen")),
    Column("unreachable", ".0f", total("unreachable")),
    Column("p99 ms", ".1f", mean_of("step_p99")),
)
"""Unseen: stop trajectories that enter a cell which was never seen; unreachable: steps in which the
goal was called so."""


def drive(driver: str, robot_name: str, kind: str, reach: float, seed: int) -> DriveResult:
    """Drive one world with one driver."""
    robot = ROBOTS[robot_name]
    return judge(driver, robot, course_of(kind, seed, robot.radius), LidarSpec(reach), seed)


def judge(driver: str, robot: Robot, course: Course, lidar: LidarSpec, seed: int) -> DriveResult:
    """Drive a robot with ``ours`` or ``pursuit``; the seed is of the lidar's noise and slip."""
    eyes = (Ours if driver == "ours" else Theirs)(robot, course, lidar, seed)
    ideal = math.hypot(*(course.goal - course.start)[:2]) / robot.speed
    tolerance = Tolerance(NEAR * robot.radius, TURNED)
    task = Task(
        course.start,
        course.goal,
        lambda pose: bool(tolerance.met(pose, course.goal)),
        lambda poses: course.world.clearance(poses[:, :2], np.zeros(len(poses))) - robot.radius,
        ideal,
        LONGEST * ideal + 40.0,
        np.array((robot.speed, robot.turn_rate)),
        robot.dt,
        HELD,
        robot.radius,
        [course.world],
    )
    row = closed_loop(eyes.step, RobotPlant(robot, seed).drive, task)
    assert row.trace is not None
    gears = _gears(robot.dt * row.trace.commands[:, 0], BACK * robot.radius)
    more = {"unseen": eyes.unseen, "unreachable": eyes.unreachable, "gears": gears}
    return replace(row, peer=driver != "ours", more=more)


class _Eyes:
    """What a robot with a lidar sees, and what of it was seen before."""

    def __init__(self, robot: Robot, course: Course, lidar: LidarSpec, seed: int) -> None:
        self.robot, self.course, self.lidar = robot, course, lidar
        self.random = np.random.default_rng([seed, 9])
        self.cells = SeenCells(course.side, robot.radius)
        self.unseen = self.unreachable = 0

    def look(self, pose: Array) -> tuple[Array, Array]:
        """Ranges, and their directions in the robot's frame."""
        ranges, directions = scan_ranges(self.course.world, self.lidar, pose, self.random)
        self.cells.look(pose, ranges, directions, self.lidar.reach)
        return ranges, directions


class Theirs(_Eyes):
    """Lattice search and pure pursuit."""

    def __init__(self, robot: Robot, course: Course, lidar: LidarSpec, seed: int) -> None:
        super().__init__(robot, course, lidar, seed)
        self.pursuit = Pursuit(robot.radius, robot.speed, robot.turn_rate, course.side)

    def step(self, pose: Array, number: int) -> Plan:
        """Look, and decide."""
        ranges, directions = self.look(pose)
        hit = np.isfinite(ranges) & (ranges > 0.0)
        along = pose[2] + directions[hit]
        ends = pose[:2] + ranges[hit, None] * np.stack([np.cos(along), np.sin(along)], axis=1)
        within = TURNS_WITHIN * self.robot.radius
        return commanded(self.pursuit.command(pose, self.course.goal, ends, within))


class Ours(_Eyes):
    """The controller, with scans alone."""

    def __init__(self, robot: Robot, course: Course, lidar: LidarSpec, seed: int) -> None:
        super().__init__(robot, course, lidar, seed)
        model, problem = learn(robot, seed), robot.problem(course.side)
        # what other work on the machine takes does not count
        self.controller = Controller(model, problem, clock=process_time)

    def step(self, pose: Array, number: int) -> Plan:
        """Look, and plan."""
        scan = scan_of(self.lidar, self.look(pose)[0])
        plan = self.controller.step(pose, self.course.goal, [scan])
        self.unreachable += plan.progress is GoalProgress.UNREACHABLE
        self.unseen += self.cells.enters_unseen(self._stop(pose), pose)
        return plan

    def _stop(self, pose: Array) -> Array:
        """The verified stop trajectory (T, 2) that the controller would drive now."""
        problem, state = self.controller.problem, self.controller.state
        motion, model = state.history.motion, state.model
        if motion is None:
            return pose[None, :2]
        commands = motion * problem.scale.command
        if model.history:
            commands = np.concatenate([commands, np.zeros((model.history, 2))])
        past = state.history.commands * problem.scale.command
        # the coming command was remembered already
        past = past[-model.history - 1 : -1] if model.history else past
        return model.rollout(pose, commands, past if len(past) == model.history else None)[:, :2]


def _gears(driven: Array, least: float) -> int:
    """How often a robot that drives distances (T,) ahead or back [m] turns back by a least one."""
    place, farthest, ahead, changes = 0.0, 0.0, 0, 0
    for step in driven:
        place += float(step)
        if ahead == 0 and abs(place) > least:
            ahead = 1 if place > 0.0 else -1
            farthest = place
        elif ahead and (place - farthest) * ahead > 0.0:
            farthest = place
        elif ahead and (farthest - place) * ahead > least:
            ahead, farthest, changes = -ahead, place, changes + 1
    return changes
