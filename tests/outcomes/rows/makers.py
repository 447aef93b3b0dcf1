"""Makers of the drives of ``rows.toml``: functions that get the seed first.

Seeds beyond 0 move and turn the start a little, and draw other slips and noises.
"""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models, sensing
from outcomes.broken_solver import BrokenWorkspace, Switch
from outcomes.lab import (
    Jumps,
    Pedestrians,
    Scenario,
    Walks,
    box_edges,
    has_passage,
    random_map,
    random_robot,
    sight_course,
)
from outcomes.plant import Array, Body, Vehicle
from outcomes.sensing import Scanner, Within
from outcomes.setup import NO_CIRCLES, Moment, Scene, Setup, area
from outcomes.steered import Bicycle, Mecanum, Rollers, Steering

SLIPS = Body(slip=0.05)
FIRST_MAP, MAPS_APART = 41_000, 500
"""Seed of the first random map, and how far apart those of two seeds of a row are."""
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


# -- anything, anywhere


def drive(
    scene: Scene,
    start: Sequence[float],
    goal: Sequence[float],
    seed: int,
    model: str | kl.KoopmanModel = "nominal",
    body: Body | Steering | Rollers = SLIPS,
    sense: str | Callable[..., Any] = "known",
    problem: Mapping[str, Any] | None = None,
    kicks: Mapping[str, Any] | None = None,
    measure: str | Callable[..., Any] | None = None,
    **more: Any,
) -> Setup:
    """One drive of the paper's robot, or of one with another body and problem.

    `sense`, `measure`: or their names. `model`: or its name.
    """
    made = kl.NavigationProblem(**{**area(scene.bounds), **(problem or {})})
    plant = more.pop("plant", None) or plant_of(body, made.dt, [seed, 3])
    known = models.model(model, made.dt) if isinstance(model, str) else model
    if isinstance(body, Rollers):
        known = kl.nominal_omni(made.dt)
    begin = np.array(start, dtype=float)
    if seed:
        size = 0.05 * made.robot_radius
        begin = begin + np.random.default_rng([seed, 21]).uniform(-1, 1, 3) * (size, size, 0.05)
    if isinstance(sense, str):
        named = getattr(sensing, sense)
        sense = named() if isinstance(named, type) else named
    if isinstance(measure, str):
        measure = MEASURES[measure]
    more["kicks"] = {int(step): by for step, by in (kicks or {}).items()}
    end = np.array(goal, dtype=float)
    return Setup(scene, begin, end, made, known, plant, sense, measure=measure, **more)


def plant_of(body: Body | Steering | Rollers, dt: float, seed: Sequence[int]) -> Any:
    """The robot as it is."""
    if isinstance(body, Body):
        return Vehicle(body, dt, seed)
    return Bicycle(body, dt, seed) if isinstance(body, Steering) else Mecanum(body, dt, seed)


def scene(
    circles: Sequence[Sequence[float]] = (),
    half: float = 2.0,
    bounds: Sequence[float] | None = None,
    boxes: Sequence[Sequence[float]] = (),
    edges: Sequence[Sequence[float]] | None = None,
    **more: Any,
) -> Scene:
    """Obstacles in a square area, or one with bounds; circles x, y, radius, vx, vy.

    `boxes` and `edges` are seen by scanners alone.
    """
    rows = [[*row, *(0.0,) * (5 - len(row))] for row in circles]
    box = tuple(bounds) if bounds is not None else (-half, -half, half, half)
    lines = None if edges is None else np.array(edges, dtype=float)
    if boxes:
        lines = np.concatenate([box_edges(*one) for one in boxes])
    return Scene(box, np.array(rows, dtype=float).reshape(-1, 5), edges=lines, **more)  # type: ignore[arg-type]


def place(
    seed: int, start: Sequence[float], goal: Sequence[float], goals: Any = (), **more: Any
) -> Setup:
    """A drive among what the line says: see `scene` and `drive`; later goals by their times."""
    around = ("circles", "half", "bounds", "boxes", "edges", "solids", "movers", "visits")
    scenery = {name: more.pop(name) for name in around if name in more}
    later = tuple((begin, np.array(pose)) for begin, pose in goals)
    return drive(scene(**scenery), start, goal, seed, goals=later, **more)


def on_map(seed: int, family: str, number: int, by: float = 1.0, **more: Any) -> Setup:
    """A drive over a random map, with lengths and speeds times a factor."""
    scenario = random_map(family, FIRST_MAP + number + MAPS_APART * seed)
    unit = np.array((by, by, 1.0))
    start, goal = unit * scenario.start, unit * scenario.goal
    plain = drive(scene_of(scenario, by), start, goal, 0, **more)
    body = more.get("body", SLIPS)
    if "plant" not in more:
        seeds = [seed, number, 3] if isinstance(body, Body) else [seed, 3]
        plain.plant = plant_of(body, plain.dt, seeds)
    return plain


def scene_of(scenario: Scenario, by: float = 1.0) -> Scene:
    """Obstacles of a scenario, with lengths and speeds times a factor."""
    rows = np.array([tuple(c) for c in scenario.circles], dtype=float).reshape(-1, 5)
    solids = (*scenario.polygons, *scenario.walls)
    if by != 1.0:
        solids = tuple(solid.scaled(1.0 / by) for solid in solids)
    grid = () if scenario.grid is None else (scenario.grid,)
    bounds = tuple(by * side for side in scenario.bounds)
    return Scene(bounds, rows * by if len(rows) else NO_CIRCLES, (*solids, *grid))  # type: ignore[arg-type]


def bundled(seed: int, name: str, **more: Any) -> Setup:
    """A drive of one of the package's own scenarios."""
    scenario = Scenario.load(name)
    return drive(scene_of(scenario), scenario.start, scenario.goal, seed, **more)


def scattered(
    random: np.random.Generator,
    half: float,
    count: int,
    sizes: tuple[float, float],
    gap: float,
    keep: Sequence[Sequence[float]] = (),
) -> Array:
    """Rows (M, 5) of circles in a square, at least a gap apart and away from poses to keep."""
    rows: list[list[float]] = []
    for _ in range(200 * count):
        if len(rows) == count:
            break
        x, y = random.uniform(-half, half, 2).tolist()
        radius = float(random.uniform(*sizes))
        free = all(math.hypot(x - r[0], y - r[1]) >= radius + r[2] + gap for r in rows)
        if free and all(math.hypot(x - k[0], y - k[1]) >= radius + gap for k in keep):
            rows.append([x, y, radius, 0.0, 0.0])
    return np.array(rows).reshape(-1, 5)


# -- places


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


# -- goals


def park(seed: int, number: int, **more: Any) -> Setup:
    """From within 0.6 m of the goal, whichever way both face."""
    random = np.random.default_rng([number, 91])
    bearing, away = random.uniform(-math.pi, math.pi), 0.6 * math.sqrt(random.uniform())
    start = (away * math.cos(bearing), away * math.sin(bearing), random.uniform(-3, 3))
    goal = (0.0, 0.0, random.uniform(-3, 3))
    return place(seed, start, goal, limit=40.0, **{"model": "slip", **more})


def tour(seed: int, number: int, count: int, every: float, **more: Any) -> Setup:
    """Goals that change while it drives."""
    setup = on_map(seed, "open", number, **{"model": "slip", "limit": 80.0, **more})
    random = np.random.default_rng([number, 93])
    places = [random.uniform((-1.7, -1.7, -9.0), (1.7, 1.7, 9.0)) for _ in range(60)]
    gaps = [
        np.hypot(*(setup.scene.circles[:, :2] - p[:2]).T).min() - setup.scene.circles[:, 2].max()
        for p in places
    ]
    free = [p for p, gap in zip(places, gaps, strict=True) if gap > 0.3][:count]
    setup.goals = tuple((every * (i + 1), goal) for i, goal in enumerate(free))
    return setup


def bad_numbers(seed: int, kind: str) -> Setup:
    """Obstacles or goals that are no numbers for a while."""
    setup = on_map(seed, "open", 385, model="slip")
    right = setup.sense

    def sense(moment: Moment) -> Any:
        if 12 <= moment.number < 18 and kind == "circle":
            return np.array([[np.nan, 0.0, 0.2, 0.0, 0.0]])
        if 12 <= moment.number < 18 and kind == "many":
            return np.tile((1.9, 1.9, 0.05, 0.0, 0.0), (20_000, 1))
        return right(moment)

    setup.sense = sense
    if kind == "goal":
        setup.goals = ((1.2, np.full(3, np.nan)), (1.8, setup.goal))
    return setup


# -- poses that are wrong, or lost


class Jump:
    """The pose is wrong by this from one step until another."""

    def __init__(self, x: float, y: float, turn: float, first: int, after: int) -> None:
        self._off, self._steps = np.array([x, y, turn]), range(first, after)

    def __call__(self, k: int, pose: Array) -> Array:
        return pose + self._off if k in self._steps else pose


class Lost:
    """There is no pose from one step until another."""

    def __init__(self, first: int, after: int) -> None:
        self._steps = range(first, after)

    def __call__(self, k: int, pose: Array) -> Array:
        return np.full(3, np.nan) if k in self._steps else pose


class Frozen:
    """The pose stays as it was from one step until another."""

    def __init__(self, first: int, after: int) -> None:
        self._steps, self._pose = range(first, after), np.zeros(3)

    def __call__(self, k: int, pose: Array) -> Array:
        if k not in self._steps:
            self._pose = pose
        return self._pose


MEASURES: dict[str, Callable[[int, Array], Array]] = {
    "lost beside a jump": lambda k, p: Lost(13, 14)(k, Jump(1, 0.5, 0.3, 12, 30)(k, p)),
    "every third lost": lambda k, p: np.full(3, np.nan) if k % 3 == 2 else p,
    "whole turns": lambda k, p: p + (0, 0, 2 * math.pi * (k % 5 - 2)),
    "infinite once": lambda k, p: p + (0, np.inf if k == 9 else 0, 0),
}


def jumping(seed: int, kind: str, size: float, number: int) -> Setup:
    """A pose that jumps again and again, as ``kmpc study jumps`` drives it."""
    row = on_map(seed, "dense", number)
    jumps = Jumps(kind, size, 300 + number + 500 * seed)
    row.measure = lambda k, pose: pose + jumps.at(0.1 * k)
    row.tolerance = (0.05, 0.15)
    if kind == "for good":
        row.frame = lambda: jumps.frame
        row.sense = lambda moment: moment.scene.circles_at(moment.time)
    return row


# -- what happens to the controller


def broken(
    seed: int, fault: str, first: int, after: int, number: int, every: int = 1, **more: Any
) -> Setup:
    """OSQP ends with a fault from one step until another."""
    switch = Switch(np.random.default_rng([seed, number]))

    def before(k: int, _: kl.Controller) -> None:
        switch.fault = fault if first <= k < after and k % every == 0 else ""

    def make(qp: Any, options: Any) -> Any:
        return BrokenWorkspace(switch, qp, options)

    setup = on_map(seed, "dense", number, **more)
    setup.before, setup.options = before, {**setup.options, "solver": make}
    return setup


class Ticks:
    """A clock that goes on by so much at each look [s]."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._now = seconds, 0.0

    def __call__(self) -> float:
        self._now += self._seconds
        return self._now


def budgeted(seed: int, seconds: float, number: int, **options: Any) -> Setup:
    """Within a time budget, by a clock of its own."""
    setup = on_map(seed, "dense", number, model="slip")
    setup.options = {"time_budget": 1.0, "clock": Ticks(seconds), **options}
    return setup


def handed_over(seed: int, number: int, how: str, **more: Any) -> Setup:
    """In the middle of the drive a copy drives on, or the controller is changed."""

    def before(k: int, controller: kl.Controller) -> kl.Controller | None:
        if how == "copied" and k % 7 == 6:
            return copy.deepcopy(controller)
        if how == "pickled" and k == 20:
            return pickle.loads(pickle.dumps(controller))  # type: ignore[no-any-return]
        if how == "reset" and k == 20:
            controller.reset()
        if how == "swapped" and k == 20:
            controller.update_model(models.model("calm"))
        return None

    setup = on_map(seed, "dense", number, **{"model": "slip", **more})
    setup.before = before
    return setup


def gated(seed: int, number: int, told: bool) -> Setup:
    """A gate with acceleration limits lies between controller and robot."""
    setup = on_map(seed, "dense", number, model="slip", gate=(0.6, 2.0))
    if told:
        setup.problem = kl.NavigationProblem(du_max=(0.6, 2.0))
    return setup


def logged(seed: int, name: str, number: int, learned: bool = True, **options: Any) -> Setup | None:
    """A plant of one half of a log, driven with a model of the other half."""
    found = models.of_log(name)
    if found is None:
        return None
    _, radius, speed, turn = models.LOGS[name]
    return on_map(
        *(seed, "open", number, radius / 0.15),
        model=found[0] if learned else "nominal",
        problem={"u_min": (-speed, -turn), "u_max": (speed, turn), "robot_radius": radius},
        plant=models.real_plant(name, number + 100 * seed),
        noise=models.pose_noise(found[1]),
        limit=90.0,
        options=options,
    )


# -- cars and omnis


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
