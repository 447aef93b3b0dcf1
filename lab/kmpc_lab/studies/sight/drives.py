"""Drives by lidar alone, judged by the truth and by a ray caster of their own.

Arrived means within 0.15 radii and 0.1 rad by the true pose, held for half a second: wider than
where robots of any size are in pose (`in_pose`), since pursuit turns on the spot as soon as it is
within a tenth of the radius, and may slip out of it. A collision is an overlap at any of ten looks
a period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import process_time

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec, scan_of, scan_ranges
from kmpc_lab.studies.any_robot import KNOWN, STANDARD, Robot, RobotPlant, learn
from kmpc_lab.studies.sight.pursuit import Pursuit
from kmpc_lab.studies.sight.seen_cells import SeenCells
from kmpc_lab.studies.sight.worlds import Course, course_of
from kmpc_lite.control import Controller
from kmpc_lite.control.plan import GoalProgress, PlanStatus
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


@dataclass(frozen=True)
class SightDrive:
    """What became of one drive."""

    driver: str
    """``ours`` or ``pursuit``."""
    robot: str
    kind: str
    reach: float
    """Of the lidar [m]."""
    seed: int
    arrived: bool
    collided: bool
    seconds: float
    clearance: float
    gears: int
    """Changes between forwards and backwards."""
    stopped: float
    """Share of steps without a plan."""
    unseen: int
    """Stop trajectories that enter a cell which was never seen."""
    unreachable: int
    """Steps in which the goal was called unreachable."""
    step_p99: float
    """[ms]."""
    ended: str


def drive(driver: str, robot_name: str, kind: str, reach: float, seed: int) -> SightDrive:
    """Drive one world with one driver."""
    robot = ROBOTS[robot_name]
    course = course_of(kind, seed, robot.radius)
    return SightLoop(driver, robot, course, LidarSpec(reach), seed).run(kind, seed)


class SightLoop:
    """One drive, from start to end.

    Parameters
    ----------
    driver : str
        ``ours`` or ``pursuit``.
    robot : Robot
        What is driven.
    course : Course
        Where.
    lidar : LidarSpec
        What it sees with.
    seed : int
        Of the lidar's noise and the robot's slip.
    """

    def __init__(
        self, driver: str, robot: Robot, course: Course, lidar: LidarSpec, seed: int
    ) -> None:
        self.driver, self.robot, self.course, self.lidar = driver, robot, course, lidar
        self.random = np.random.default_rng([seed, 9])
        self.plant = RobotPlant(robot, seed)
        self.pose: Array = course.start.copy()
        self.controller, self.pursuit = None, None
        if driver == "ours":
            model, problem = learn(robot, seed), robot.problem(course.side)
            # what other work on the machine takes does not count
            self.controller = Controller(model, problem, clock=process_time)
        else:
            self.pursuit = Pursuit(robot.radius, robot.speed, robot.turn_rate, course.side)
        self.cells = SeenCells(course.side, robot.radius)
        self.commands: list[Array] = []
        self.places: list[Array] = [self.pose]
        self.statuses: list[PlanStatus] = []
        self.times: list[float] = []
        self.unseen = self.unreachable = 0
        self.ended = ""

    def command(self) -> Array:
        """Look, and decide."""
        lidar, pose = self.lidar, self.pose
        ranges, directions = scan_ranges(self.course.world, lidar, pose, self.random)
        self.cells.look(pose, ranges, directions, lidar.reach)
        if self.controller is None:
            assert self.pursuit is not None
            hit = np.isfinite(ranges) & (ranges > 0.0)
            along = pose[2] + directions[hit]
            ends = pose[:2] + ranges[hit, None] * np.stack([np.cos(along), np.sin(along)], axis=1)
            return self.pursuit.command(
                pose, self.course.goal, ends, TURNS_WITHIN * self.robot.radius
            )
        scan = scan_of(lidar, ranges)
        plan = self.controller.step(pose, self.course.goal, [scan])
        self.statuses.append(plan.status)
        self.times.append(1e3 * plan.timing["total"])
        self.unreachable += plan.progress is GoalProgress.UNREACHABLE
        self.unseen += self.cells.enters_unseen(self._stop(pose), pose)
        self.ended = f"{plan.progress.value}: {plan.reason}" if plan.reason else ""
        return plan.command

    def _stop(self, pose: Array) -> Array:
        """The verified stop trajectory (T, 2) that the controller would drive now."""
        assert self.controller is not None
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

    def run(self, kind: str, seed: int) -> SightDrive:
        """Drive to the end."""
        robot, course = self.robot, self.course
        ideal = math.hypot(*(course.goal - course.start)[:2]) / robot.speed
        limit, inside, clearance, k = LONGEST * ideal + 40.0, 0.0, np.inf, 0
        tolerance = Tolerance(NEAR * robot.radius, TURNED)
        while k * robot.dt < limit and inside < HELD and clearance >= 0.0:
            command = self.command()
            poses = self.plant.drive(self.pose, command)
            self.pose, k = poses[-1], k + 1
            self.commands.append(command)
            self.places.append(self.pose)
            gaps = course.world.clearance(poses[:, :2], np.zeros(len(poses))) - robot.radius
            clearance = min(clearance, float(gaps.min()))
            inside = inside + robot.dt if tolerance.met(self.pose, course.goal) else 0.0
        stopped = sum(s is PlanStatus.STOPPED for s in self.statuses)
        return SightDrive(
            self.driver,
            robot.name,
            kind,
            self.lidar.reach,
            seed,
            inside >= HELD,
            clearance < 0.0,
            k * robot.dt - HELD,
            clearance,
            _gears(robot.dt * np.array(self.commands)[:, 0], BACK * robot.radius),
            stopped / k,
            self.unseen,
            self.unreachable,
            float(np.quantile(self.times, 0.99)) if self.times else math.nan,
            self.ended,
        )


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
