"""Drives in places of their own: fields, houses, forests, lanes, by lidar and among people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models
from outcomes.lab import Pedestrians, Walks, box_edges, has_passage, random_robot, sight_course
from outcomes.plant import Array, Body
from outcomes.rows.build import SLIPS, drive, on_map, place, scattered
from outcomes.sensing import Scanner, Within
from outcomes.setup import Scene, Setup
from outcomes.steered import Steering

GOLF_RADIUS, GOLF_SPEED = 2.64, 2.5
GOLF_CART = {
    "horizon": 30,
    "u_min": (-1.0, -GOLF_SPEED / GOLF_RADIUS),
    "u_max": (GOLF_SPEED, GOLF_SPEED / GOLF_RADIUS),
    "du_max": (2.0, math.inf),
    "footprint": kl.Footprint.rectangle(2.4, 1.2, ahead=0.825),
    "wheels": kl.Car(GOLF_RADIUS),
    "goal_tolerance": (0.2, 0.1),
}


def ragged(seed: int) -> Setup:
    """Walls as a lidar's map has them."""
    random, grid = np.random.default_rng(0), np.zeros((120, 120), dtype=bool)
    for column in range(120):
        if not 80 <= column < 94:
            grid[40 + column // 3 : 44 + column // 3 + random.integers(0, 3), column] = True
    walls = kl.OccupancyGrid(grid, 0.05, (-3.0, -3.0, 0.0))
    return place(seed, (-1, -2, 0), (-1, 1.5, 0), half=3.0, solids=(walls,), model="slip")


def large_grid(seed: int, cells: int) -> Setup:
    """Rooms of a big house, as one grid."""
    size, resolution = cells, 12.0 / cells
    grid = np.zeros((size, size), dtype=bool)
    for k in range(1, 4):
        grid[:, k * size // 4] = True
        grid[k * size // 4, :] = True
    door = round(0.9 / resolution)
    for row in range(4):
        for column in range(4):
            x, y = column * size // 4, row * size // 4
            grid[y + size // 10 : y + size // 10 + door, x] = column == 0
            grid[y, x + size // 8 : x + size // 8 + door] = row == 0
    grid[0] = grid[-1] = True
    grid[:, 0] = grid[:, -1] = True
    house = kl.OccupancyGrid(grid, resolution, (-6.0, -6.0, 0.0))
    return place(seed, (-5, -5, 0), (5, 4.8, 1), half=6.0, solids=(house,), limit=90.0)


def spiral(seed: int) -> Setup:
    """To the middle of walls that wind round it."""
    walls, length = [], 0.5
    x = y = 0.0
    for k in range(9):
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[k % 4]
        length += 0.35
        walls.append(kl.Wall(x, y, x + dx * length, y + dy * length, 0.06))
        x, y = x + dx * length, y + dy * length
    return place(seed, (-3, 3, 0), (0.45, 0.6, 0), half=4.0, solids=tuple(walls), limit=120.0)


def forest(seed: int, count: int) -> Setup:
    """Across many circles."""
    random = np.random.default_rng([seed, 31])
    start, goal = (-5.5, -5.5, 0.0), (5.5, 5.5, 1.0)
    rows = scattered(random, 5.8, count, (0.05, 0.2), 0.42, (start, goal))
    return drive(Scene((-6, -6, 6, 6), rows), start, goal, seed, "slip", limit=90.0)


def field(
    seed: int,
    radius: float,
    speed: float,
    turn: float,
    side: float,
    count: int,
    number: int = 0,
    problem: Mapping[str, Any] | None = None,
) -> Setup:
    """A robot on a field of circles of its own size, from one side to the other."""
    random, half = np.random.default_rng([seed, number, 41]), 0.5 * side
    bearing = random.uniform(-0.7, 0.7, 2)
    start = (-0.85 * half, float(bearing[0]) * half, float(random.uniform(-3, 3)))
    goal = (0.85 * half, float(bearing[1]) * half, float(random.uniform(-3, 3)))
    rows = scattered(
        *(random, 0.9 * half, count, (0.5 * radius, 2.5 * radius), 3.2 * radius, (start, goal))
    )
    speeds = {"u_min": (-speed, -turn), "u_max": (speed, turn), "robot_radius": radius}
    limit = 6.0 * 2.2 * half / speed + 20.0
    around = Scene((-half, -half, half, half), rows)
    return drive(around, start, goal, seed, problem={**speeds, **(problem or {})}, limit=limit)


def fast_field(
    seed: int,
    number: int,
    speed: float,
    ramp: tuple[float, float],
    side: float,
    knows: str = "given",
    reach: float = 0.0,
) -> Setup:
    """A robot with real accelerations among 15 to 25 circles."""
    random, half = np.random.default_rng([seed, number, 71]), 0.5 * side
    radius = 0.15 if side < 20.0 else 0.3
    start = (-0.8 * half, float(random.uniform(-0.6, 0.6)) * half, float(random.uniform(-3, 3)))
    goal = (0.8 * half, float(random.uniform(-0.6, 0.6)) * half, float(random.uniform(-3, 3)))
    count, sizes = int(random.integers(15, 26)), (radius, 0.06 * side)
    rows = scattered(random, 0.85 * half, count, sizes, 3.0 * radius, (start, goal))
    turn = min(math.pi / 4 * speed / 0.6, 2.0)
    body, model = Body(SLIPS.slip, ramp=ramp), "nominal"
    problem = {"robot_radius": radius, "u_min": (-speed, -turn), "u_max": (speed, turn)}
    if knows == "given":
        problem |= {"du_max": ramp, "deceleration": ramp}
    elif knows == "learned":
        model = models.learned_body(body, 0.1, (speed, turn))
    more: dict[str, Any] = {}
    if reach:
        problem["sensor_range"], more["sense"] = reach, Within(reach)
    more |= {"problem": problem, "limit": 5.0 * side / speed + 20.0}
    return drive(Scene((-half, -half, half, half), rows), start, goal, seed, model, body, **more)


def drawn(seed: int, number: int) -> Setup:
    """A robot drawn at random, learned from its own log, on a map of its size."""
    robot = random_robot(number, True)
    by, bounds = robot.radius / 0.15, (robot.speed, robot.turn_rate)
    body = Body(
        robot.slip,
        (1.0, robot.turn_gain),
        robot.lag,
        robot.dead_time,
        turning_point=robot.turning_point,
    )
    round_one = {"robot_radius": robot.radius}
    shape = {"footprint": robot.footprint} if robot.footprint else round_one
    return on_map(
        *(seed, "open", number - 900_000 + 300, by),
        model=models.learned(robot, number),
        body=body,
        problem={"dt": robot.dt, "u_min": (-bounds[0], -bounds[1]), "u_max": bounds, **shape},
        noise=robot.noise,
        limit=20.0 + 40.0 * robot.radius / robot.speed + 20.0 / robot.turn_rate,
    )


def moved(seed: int, number: int, x: float, y: float, turn: float) -> Setup:
    """The same map elsewhere, or turned."""
    setup = on_map(seed, "open", number)
    bounds = (x - 2.0, y - 2.0, x + 2.0, y + 2.0)
    rows = setup.scene.circles + (x, y, 0.0, 0.0, 0.0)
    at = [pose + (x, y, turn) for pose in (setup.start, setup.goal)]
    return place(seed, *at, circles=rows, bounds=bounds)


# -- by lidar


def by_lidar(
    seed: int, kind: str, number: int, radius: float = 0.15, reach: float = 4.0, **more: Any
) -> Setup:
    """A world that nobody has told of, by lidar alone."""
    course = sight_course(kind, 7_000 + number + 500 * seed, radius)
    half, by = 0.5 * course.side, radius / 0.15
    around = Scene((-half, -half, half, half), course.world.circles, edges=course.world.edges)
    speeds = more.pop("speeds", (0.6 * by, math.pi / 4))
    limits = {"robot_radius": radius, "u_min": (-speeds[0], -speeds[1]), "u_max": speeds}
    scanner = Scanner(reach, **more.pop("scanner", {}))
    ideal = math.hypot(*(course.goal - course.start)[:2]) / speeds[0]
    return drive(
        *(around, course.start, course.goal, seed),
        problem={**limits, **more.pop("problem", {})},
        sense=scanner,
        limit=4.0 * ideal + 40.0,
        tolerance=(0.15 * radius, 0.1),
        **more,
    )


def barn(seed: int, number: int, fill: float, beams: int, speed: float, ramp: float) -> Setup:
    """A field of cylinders from a cellular automaton, as the BARN challenge has, and a Jackal."""
    random = np.random.default_rng([seed, number, 61])
    start, goal = np.array((0.0, -1.0, math.pi / 2)), np.array((0.0, 10.0, math.pi / 2))
    bounds = (-2.25, -2.0, 2.25, 11.0)
    for _ in range(300):
        cells = random.random((60, 30)) < fill
        for _ in range(4):
            near = sum(
                np.roll(np.roll(np.pad(cells, 1), dy, 0), dx, 1)[1:-1, 1:-1]
                for dy in (-1, 0, 1)
                for dx in (-1, 0, 1)
                if dy or dx
            )
            cells = np.where(near >= 5, True, np.where(near <= 1, False, cells))
        y, x = np.nonzero(cells)
        rows = np.stack([0.15 * x - 2.175, 0.15 * y + 0.075, np.full(len(x), 0.075)], axis=1)
        if has_passage(rows, start, goal, 0.31, np.array(bounds), cell=0.05):
            break
    circles = np.hstack([rows, np.zeros((len(rows), 2))])
    problem = {
        "footprint": kl.Footprint.rectangle(0.508, 0.43),
        "u_min": (-speed, -1.5),
        "u_max": (speed, 1.5),
        "du_max": (ramp, 6.0),
        "deceleration": (ramp, 6.0),
    }
    return drive(
        Scene(bounds, circles, edges=box_edges(-2.6, -2.4, 2.6, 11.4)),
        *(start, goal, seed),
        problem=problem,
        body=Body(0.03, ramp=(ramp, 6.0)),
        sense=Scanner(10.0, beams, view=1.5 * math.pi, mount=(0.12, 0.0, 0.0)),
        limit=70.0,
        tolerance=(0.15, 0.3),
    )


# -- what moves


class Path:
    """A circle that walks from place to place at a speed, as if nobody were there."""

    def __init__(self, places: Any, speed: float, radius: float = 0.2, begin: float = 0.0) -> None:
        self._places, self._radius = np.array(places, dtype=float), radius
        legs = np.hypot(*np.diff(self._places, axis=0).T)
        self._times = begin + np.concatenate([[0.0], np.cumsum(legs)]) / speed

    def at(self, time: float) -> Array:
        """One row (1, 5)."""
        place = [np.interp(time, self._times, self._places[:, i]) for i in range(2)]
        leg = int(np.searchsorted(self._times, time, side="right")) - 1
        velocity = np.zeros(2)
        if 0 <= leg < len(self._places) - 1:
            step = self._places[leg + 1] - self._places[leg]
            velocity = step / (self._times[leg + 1] - self._times[leg])
        return np.array([[*place, self._radius, *velocity]])


class Crowd:
    """Pedestrians who walk and ignore the robot."""

    def __init__(self, walks: Walks, seed: int, away_from: Array, dt: float, looks: int) -> None:
        self._crowd, self._dt, self._looks = Pedestrians(walks, seed, away_from), dt, looks
        self._rows = [self._crowd.circles]

    def at(self, time: float) -> Array:
        """Rows (M, 5)."""
        number = round(time / self._dt * self._looks)
        while len(self._rows) <= number:
            places = self._crowd.walk(self._dt, self._looks)
            now = self._crowd.circles
            for spot in places:
                row = now.copy()
                row[:, :2] = spot
                self._rows.append(row)
        return self._rows[number].copy()


def among(seed: int, number: int, count: int, turning: bool, sense: str) -> Setup:
    """Across an area of 6 m among people."""
    random = np.random.default_rng([number, seed, 81])
    side = float(random.choice([-1.0, 1.0]))
    start = (-2.2 * side, float(random.uniform(-2, 2)), float(random.uniform(-3, 3)))
    goal = (2.2 * side, float(random.uniform(-2, 2)), float(random.uniform(-3, 3)))
    walks, away = Walks(count, turning), np.array(start[:2])
    crowd = Crowd(walks, 3_000 + number + 100 * seed, away, 0.1, 10)
    more = {"movers": crowd, "sense": sense, "limit": 60.0, "tolerance": (0.05, 0.15)}
    return place(seed, start, goal, half=3.0, **more)


def noisy_radii(seed: int) -> Setup:
    """Radii and velocities come with noise: no other map, no search each step."""
    row = on_map(seed, "dense", 95)

    def noisy(moment: Any) -> Any:
        rows = moment.scene.circles_at(moment.time)
        rows[:, 2] += 1e-3 * moment.random.normal(size=len(rows))
        rows[:, 3:] += 1e-3 * moment.random.normal(size=(len(rows), 2))
        return rows

    row.sense = noisy
    return row


def free(seed: int, number: int, **more: Any) -> Setup:
    """From any pose to any other."""
    random, size = np.random.default_rng([number, 33]), (1.4, 1.4, math.pi)
    start, goal = random.uniform(-1, 1, 3) * size, random.uniform(-1, 1, 3) * size
    return place(seed, start, goal, half=2.5, **more)


def golf_corridor(seed: int, width: float, bend: float, drawn: int = -1, **options: Any) -> Setup:
    """A corridor with two bends, for a golf cart whose motor lags more than its model knows."""
    seed = seed if drawn < 0 else drawn
    random = np.random.default_rng([seed, round(100 * width)])
    first, second = random.uniform(8.0, 12.0, 2).tolist()
    steps = [(4.0 + first, 0.0), (second, bend), (8.0, 0.0)]
    moves = [(d * math.cos(a), d * math.sin(a)) for d, a in steps]
    line = np.array([(-4.0, 0.0), *moves]).cumsum(axis=0)
    # walls meet on the bisectors
    aside = [(0.0, 1.0), *2 * [(-math.tan(0.5 * bend), 1.0)], (0.0, 1.0)]
    sides = [line + 0.5 * sign * width * np.array(aside) for sign in (1, -1)]
    solids = [kl.Wall(*a, *b, 0.05) for side in sides for a, b in zip(side, side[1:], strict=False)]
    return place(
        *(seed, (0, 0, 0), (line[3, 0] - 5.0, line[3, 1], 0.0)),
        bounds=(-5.0, -25.0, 35.0, 25.0),
        solids=tuple(solids),
        body=Steering(1.0 / GOLF_RADIUS, rate=0.8, lag=0.34),
        problem=GOLF_CART,
        options=options,
        tolerance=(0.3, 0.2),
        limit=60.0,
    )
