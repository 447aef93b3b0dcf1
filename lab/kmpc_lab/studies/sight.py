"""Drives by lidar alone, judged by the truth and by a ray caster of their own.

Worlds are rooms, mazes and forests of a robot's size, unknown to it. Arrived means within 0.15
radii and 0.1 rad by the true pose, held for half a second: wider than where robots of any size are
in pose (`in_pose`), since pursuit turns on the spot as soon as it is within a tenth of the radius,
and may slip out of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from kmpc_lab.sim.lidar import LidarSpec, box_edges, scan_of, scan_ranges
from kmpc_lab.sim.maps import has_passage
from kmpc_lab.studies.any_robot import KNOWN, STANDARD, Robot, RobotPlant, learn
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop, commanded
from kmpc_lab.studies.pursuit import Pursuit, SeenCells
from kmpc_lab.studies.table import DRIVES, SECONDS, STOPPED, Column, Rows, mean_of, median_of
from kmpc_lite.control import Controller
from kmpc_lite.control.plan import GoalProgress, Plan
from kmpc_lite.control.world.shapes import Circle, Polygon
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.scenario.touch import Tolerance
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

SIDE = 7.0  # of the area of a robot of `UNIT_RADIUS` [m]
PASSAGE = 0.08  # distance beyond its radius that a way to the goal keeps [m]
THICK = 0.1  # of a wall [m]
ATTEMPTS = 200
Random = np.random.Generator
ROBOTS: dict[str, Robot] = {"standard": STANDARD, KNOWN[0].name: KNOWN[0]}
NEAR, TURNED = 0.15, 0.1  # tolerances of arrival [radii, rad]
TURNS_WITHIN = 0.1  # how near its goal pursuit turns on the spot [radii]
HELD = 0.5  # how long the goal must be held [s]
LONGEST = 8.0  # drives end after this many times the time of the straight line, and 40 s
BACK = 0.2
"""How far a robot must drive back for a change of gear [radii]: less is a turn on the spot."""


@dataclass(frozen=True)
class Course:
    """A world, and where from and where to."""

    name: str
    world: World
    start: Array  # (3,)
    goal: Array  # (3,)
    side: float  # of the area [m]


@dataclass(frozen=True)
class Drawn:
    """What a kind of world consists of, for a robot of `UNIT_RADIUS`."""

    circles: Array  # (M, 3) rows x, y, radius [m]
    boxes: Array  # (B, 4) rows x1, y1, x2, y2 [m]
    start: Array
    goal: Array


def course_of(kind: str, seed: int, radius: float) -> Course:
    """Draw a world for a robot of a radius [m], with a way to the goal."""
    random = np.random.default_rng([seed, sum(kind.encode())])
    half, by = 0.5 * SIDE, radius / UNIT_RADIUS
    for _ in range(ATTEMPTS):
        drawn = KINDS[kind](random)
        x1, y1, x2, y2 = drawn.boxes.T
        solids = [
            Polygon([(a, b), (c, b), (c, d), (a, d)])
            for a, b, c, d in zip(x1, y1, x2, y2, strict=True)
        ]
        bounds = np.array([-half, -half, half, half]) + UNIT_RADIUS * np.array([1, 1, -1, -1])
        circles = np.array([Circle(*row) for row in drawn.circles]).reshape(-1, 5)
        clearance = UNIT_RADIUS + PASSAGE
        if has_passage(
            circles, drawn.start, drawn.goal, clearance, bounds, cell=0.04, solids=solids
        ):
            break
    edges = [box_edges(*box) for box in drawn.boxes] + [box_edges(-half, -half, half, half)]
    scale = np.array([by, by, by, 1.0, 1.0])
    unit = np.array([by, by, 1.0])
    world = World(circles * scale, by * np.concatenate(edges))
    return Course(f"{kind} {seed}", world, unit * drawn.start, unit * drawn.goal, by * SIDE)


def _ends(random: Random) -> tuple[Array, Array]:
    """Start and goal in opposite corners."""
    half = 0.5 * SIDE
    corner = np.array(random.choice([-1.0, 1.0], 2))
    places = [sign * corner * (half - random.uniform(0.4, 0.8, 2)) for sign in (1.0, -1.0)]
    start, goal = (np.append(p, random.uniform(-math.pi, math.pi)) for p in places)
    return start, goal


def _forest(random: Random) -> Drawn:
    """Thirty to forty-five trunks."""
    count, half = int(random.integers(30, 46)), 0.5 * SIDE
    places = random.uniform(-half + 0.2, half - 0.2, (count, 2))
    sizes = random.uniform(0.04, 0.25, count)
    return Drawn(np.column_stack([places, sizes]), np.empty((0, 4)), *_ends(random))


def _maze(random: Random) -> Drawn:
    """A maze of 6 x 6 cells, with some of its walls taken away."""
    cells = 6
    step, half = SIDE / cells, 0.5 * SIDE
    walls = {(x, y, d) for x in range(cells) for y in range(cells) for d in (0, 1)}
    walls -= {(cells - 1, y, 0) for y in range(cells)} | {(x, cells - 1, 1) for x in range(cells)}
    known, trail = {(0, 0)}, [(0, 0)]
    while trail:
        x, y = trail[-1]
        ways = [
            ((x + dx, y + dy), (x + min(dx, 0), y + min(dy, 0), int(dx == 0)))
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
            if 0 <= x + dx < cells and 0 <= y + dy < cells and (x + dx, y + dy) not in known
        ]
        if not ways:
            trail.pop()
            continue
        place, wall = ways[int(random.integers(len(ways)))]
        walls.discard(wall)
        known.add(place)
        trail.append(place)
    kept = [wall for wall in sorted(walls) if random.random() < 0.8]
    boxes = []
    for x, y, d in kept:
        low = np.array([x + (d == 0), y + (d == 1)]) * step - half
        high = low + step * np.array([d == 1, d == 0])
        boxes.append((*(low - 0.5 * THICK), *(high + 0.5 * THICK)))
    places = np.array([(0.5, 0.5), (cells - 0.5, cells - 0.5)]) * step - half
    if random.random() < 0.5:
        places = places[::-1]
    start, goal = (np.append(p, random.uniform(-math.pi, math.pi)) for p in places)
    return Drawn(np.empty((0, 3)), np.array(boxes).reshape(-1, 4), start, goal)


def _rooms(random: Random) -> Drawn:
    """Four to six rooms with doors, and furniture."""
    half = 0.5 * SIDE
    x, y = random.uniform(-1.0, 1.0, 2)
    boxes = _wall(random, x, (-half, y), True) + _wall(random, x, (y, half), True)
    boxes += _wall(random, y, (-half, x), False) + _wall(random, y, (x, half), False)
    for _ in range(int(random.integers(5, 10))):
        corner, size = random.uniform(-half, half - 0.5, 2), random.uniform(0.2, 0.6, 2)
        boxes.append((*corner, *(corner + size)))
    circles = np.column_stack([random.uniform(-half, half, (6, 2)), np.full(6, 0.04)])
    return Drawn(circles, np.array(boxes), *_ends(random))


def _wall(
    random: Random, place: float, along: tuple[float, float], upright: bool
) -> list[tuple[float, float, float, float]]:
    """Two boxes of a wall, with a door of 0.6 to 0.9 m between them."""
    low, high = along
    width = random.uniform(0.6, 0.9)
    begin = random.uniform(low + 0.2, high - 0.2 - width)
    thick = 0.5 * THICK
    parts = [(low, begin), (begin + width, high)]
    if upright:
        return [(place - thick, a, place + thick, b) for a, b in parts]
    return [(a, place - thick, b, place + thick) for a, b in parts]


KINDS: dict[str, Callable[[Random], Drawn]] = {"rooms": _rooms, "maze": _maze, "forest": _forest}
"""``rooms``: a house with doors of 0.6 to 0.9 m and furniture; ``maze``: 6 x 6 cells of 1.17 m;
``forest``: 30 to 45 trunks; all for a robot of `UNIT_RADIUS`."""


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
