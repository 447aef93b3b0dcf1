"""Study ``pedestrians``: drives among pedestrians that ignore the robot.

Touches are told apart by the truth: the robot *drives into* a pedestrian that it approaches at
the moment of the contact, having moved within the last second; it *is met* while it moves
otherwise; a robot that has stood for a second *is walked into*. Only the first is its collision.
Contacts do not end the drive: it ends where the robot first is within the tolerances of its goal.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec
from kmpc_lab.sim.pedestrians import Pedestrians, Walks
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.contenders import DT
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop
from kmpc_lab.studies.sight import total
from kmpc_lab.studies.table import JERK, SECONDS, STOPPED, Column, Rows, count_of
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import Plan
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.model.koopman import nominal_unicycle
from kmpc_lite.scenario.touch import ARRIVED, LOOKS
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

NOISE = 0.01  # of noisy circles, along each axis [m]
STOOD = 1.0  # how long a robot must have stood to be walked into [s]
STANDS = 0.01  # within how much of one place [m]
AT_REST = 1e-3
"""Speed up to which the robot approaches nobody: what is left of a command to stand [m/s]."""
APART = 0.1  # how far apart they must be for the next contact to count [m]
TIMEOUT = 60.0  # [s]
SLIP = 0.05
LIDAR = LidarSpec()
CONTACTS = "driven_into", "met", "walked_into"


def p90(rows: Rows) -> float:
    """Time [s] that one in ten of those who arrive exceeds."""
    times = [row.seconds for row in rows if row.arrived]
    return float(np.quantile(times, 0.9)) if times else math.nan


COLUMNS = (
    Column("drives", "d", len),
    Column("arrived", "d", count_of("arrived")),
    *(Column(name.replace("_", " "), ".0f", total(name)) for name in CONTACTS),
    SECONDS,
    Column("p90 [s]", ".1f", p90),
    STOPPED,
    JERK,
)


def ends(seed: int, side: float) -> tuple[Array, Array]:
    """Start and goal (3,) of a drive across the area."""
    random, half = np.random.default_rng([seed, 2]), 0.4 * side
    while True:
        start, goal = random.uniform(-1.0, 1.0, (2, 3)) * (half, half, math.pi)
        if np.hypot(*(goal - start)[:2]) >= 0.5 * side:
            return start, goal


class Crowd:
    """Pedestrians, and an account of whom the robot touches, and how.

    `walks`: how they walk. `seed`: of the walks. `place`: of the robot (2,), at the start.
    `radius`: of the robot [m].
    """

    def __init__(self, walks: Walks, seed: int, place: Array, radius: float) -> None:
        self.people, self._near = Pedestrians(walks, seed, place), walks.radius + radius
        self._touching, self._trail = np.zeros(walks.count, dtype=bool), [place]
        self.contacts = dict.fromkeys(CONTACTS, 0)

    def walk(self, poses: Array) -> None:
        """They walk for a period, in which the robot is at poses (LOOKS, 3)."""
        for at, there in zip(poses, self.people.walk(DT, LOOKS), strict=True):
            self._trail.append(at[:2])
            gaps = np.hypot(*(there - at[:2]).T) - self._near
            for i in np.flatnonzero((gaps < 0.0) & ~self._touching):
                self.contacts[_kind(np.array(self._trail), there[i])] += 1
            self._touching = (gaps < 0.0) | (self._touching & (gaps < APART))


def drive(people: int, walk: str, seen: str, seed: int) -> DriveResult:
    """Drive a robot of 0.15 m and 0.6 m/s across the area.

    The controller is ``told`` the pedestrians' velocity, is given ``zero``, or zero and ``noisy``
    places, or scans of a ``lidar`` alone.
    """
    walks = Walks(people, walk == "turning")
    half = 0.5 * walks.side
    problem = NavigationProblem(x_min=(-half, -half, -np.inf), x_max=(half, half, np.inf))
    controller = Controller(nominal_unicycle(DT), problem)
    start, goal = ends(seed, walks.side)
    crowd = Crowd(walks, seed, start[:2], problem.robot_radius)
    plant, noise = DifferentialDrive(SLIP, seed), np.random.default_rng([seed, 4])

    def step(pose: Array, number: int) -> Plan:
        if seen == "lidar":
            return controller.step(pose, goal, [_scan(pose, crowd.people.circles, noise)])
        return controller.step(pose, goal, _as_seen(crowd.people.circles, seen, noise))

    def move(pose: Array, command: Array) -> Array:
        poses = plant.trace(pose, command, DT, LOOKS)
        crowd.walk(poses)
        return poses

    task = Task(
        start,
        goal,
        lambda pose: bool(ARRIVED.met(pose, goal)),
        lambda poses: np.empty(0),
        math.dist(start[:2], goal[:2]) / problem.u_max[0],
        TIMEOUT,
        np.array(problem.u_max),
        DT,
        held=0.0,
        around=[World(crowd.people.circles)],
    )
    row = closed_loop(step, move, task)
    return replace(row, collided=crowd.contacts["driven_into"] > 0, more=crowd.contacts)


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
