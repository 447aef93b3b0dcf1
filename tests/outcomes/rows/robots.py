"""Robots of every size, speed, period and shape."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models
from outcomes.lab import Robot, random_robot
from outcomes.plant import Body
from outcomes.rows.build import Table, drive, on_map, scattered, scene, sized
from outcomes.setup import Scene, Setup

SCALES = Table("scales")
for by in (0.1, 0.25, 3.0, 10.0, 30.0):
    for place, family in enumerate(("open", "dense", "trap", "moving")):
        SCALES.add(
            f"x{by:g}: {family} map",
            on_map,
            family,
            100 + place,
            by=by,
            problem=sized(by),
            quick=(by, family) in ((0.1, "dense"), (30.0, "open")),
        )


def field(
    seed: int,
    radius: float,
    speed: float,
    turn: float,
    side: float,
    count: int,
    number: int = 0,
    **more: Any,
) -> Setup:
    """A robot on a field of circles of its own size, from one side to the other."""
    random, half = np.random.default_rng([seed, number, 41]), 0.5 * side
    bearing = random.uniform(-0.7, 0.7, 2)
    start = (-0.85 * half, float(bearing[0]) * half, float(random.uniform(-3, 3)))
    goal = (0.85 * half, float(bearing[1]) * half, float(random.uniform(-3, 3)))
    sizes = (0.5 * radius, 2.5 * radius)
    rows = scattered(random, 0.9 * half, count, sizes, 3.2 * radius, (start, goal))
    problem = {
        "u_min": (-speed, -turn),
        "u_max": (speed, turn),
        "robot_radius": radius,
        **more.pop("problem", {}),
    }
    ideal = 2.2 * half / speed
    more.setdefault("limit", 6.0 * ideal + 20.0)
    scene_ = Scene((-half, -half, half, half), rows)
    return drive(scene_, start, goal, seed, problem=problem, **more)


KNOWN = Table("robots")
HUSKY = {"radius": 0.5, "speed": 1.0, "turn": 1.0}
WARTHOG = {"radius": 0.9, "speed": 4.0, "turn": 2.0}
for number in range(2):
    for name, size, side, count, quick in (
        ("Husky-like in 20 m, field {}: arcs of its own were thrown away", HUSKY, 20.0, 40, 0),
        ("Husky-like in 40 m, field {}", HUSKY, 40.0, 80, None),
        ("Warthog-like in 100 m, field {}", WARTHOG, 100.0, 90, 1),
    ):
        drawn = {"side": side, "count": count, "number": number, "quick": number == quick}
        KNOWN.add(name.format(number), field, **size, **drawn)
    KNOWN.add(
        f"micro of 4 cm, field {number}",
        field,
        radius=0.04,
        speed=0.2,
        turn=math.pi / 4,
        side=1.2,
        count=14,
        number=number,
        problem={"dt": 0.05},
    )
    KNOWN.add(
        f"forward only, map {number}: stood 11 mm from its goal for ever",
        on_map,
        "open",
        120 + number,
        problem={"u_min": (0.0, -math.pi / 4)},
        quick=number == 0,
    )
    KNOWN.add(
        f"forward only of 1.5 m, map {number}",
        on_map,
        "open",
        122 + number,
        by=10.0,
        problem={**sized(10.0), "u_min": (0.0, -math.pi / 4)},
    )
    KNOWN.add(
        f"slow turner, map {number}",
        on_map,
        "open",
        124 + number,
        problem={"u_min": (-0.6, -0.25), "u_max": (0.6, 0.25)},
        limit=90.0,
    )
    KNOWN.add(
        f"fast: 3 m/s and 2 rad/s, map {number}",
        on_map,
        "open",
        126 + number,
        problem={"u_min": (-3.0, -2.0), "u_max": (3.0, 2.0)},
    )


def drawn(seed: int, number: int, shapes: bool) -> Setup:
    """A robot drawn at random, learned from its own log, on a map of its size."""
    robot = random_robot(number, shapes)
    return drive_robot(seed, robot, number)


def drive_robot(seed: int, robot: Robot, number: int, family: str = "open") -> Setup:
    by, bounds = robot.radius / 0.15, (robot.speed, robot.turn_rate)
    body = Body(
        robot.slip,
        (1.0, robot.turn_gain),
        robot.lag,
        robot.dead_time,
        turning_point=robot.turning_point,
    )
    found = models.learned(robot, number)
    shape = (
        {"robot_radius": robot.radius}
        if robot.footprint is None
        else {"footprint": robot.footprint}
    )
    problem = {"dt": robot.dt, "u_min": (-bounds[0], -bounds[1]), "u_max": bounds, **shape}
    return on_map(
        *(seed, family, number - 900_000 + 300, by),
        model=found,
        body=body,
        problem=problem,
        noise=robot.noise,
        limit=20.0 + 40.0 * robot.radius / robot.speed + 20.0 / robot.turn_rate,
    )


ANY = Table("any robot")
for number in range(900_000, 900_020):
    robot = random_robot(number, True)
    shape = "round" if robot.footprint is None else "not round"
    ANY.add(
        f"drawn robot {number - 900_000}, {shape}: r {robot.radius:.2g} m {robot.speed:.2g} m/s",
        drawn,
        number,
        True,
    )


RATES = Table("periods")
for dt, horizon, count in (
    (0.05, 25, 2),
    (0.2, 20, 2),
    (0.3, 20, 1),
    (0.5, 10, 2),
    (0.5, 20, 1),
    (1.0, 10, 3),
    (1.0, 20, 3),
    (1.0, 40, 2),
):
    for number in range(count):
        RATES.add(
            f"period {dt:g} s and horizon {horizon}, map {number}",
            on_map,
            "open",
            140 + number,
            problem={"dt": dt, "horizon": horizon},
            limit=80.0,
            quick=(dt, horizon, number) in ((1.0, 20, 0), (0.05, 25, 0)),
        )
RATES.add(
    "at 1 Hz a small circle was waited before for ever",
    lambda seed: drive(
        scene((0.0, 0.02, 0.05), (0.6, 0.5, 0.08)),
        (-1.5, 0.0, 0.0),
        (1.5, 0.0, 0.0),
        seed,
        problem={"dt": 1.0},
    ),
    quick=True,
)
RATES.add("horizon 10 at 10 Hz", on_map, "dense", 150, problem={"horizon": 10})
RATES.add("horizon 40 at 10 Hz", on_map, "dense", 151, problem={"horizon": 40})
RATES.add(
    "50 Hz with noisy poses left its goal",
    on_map,
    "open",
    152,
    problem={"dt": 0.02, "horizon": 30},
    noise=(0.005, 0.02),
    limit=40.0,
)

BOUNDS = Table("bounds")
for name, low, high in (
    ("forward only, 0.6 m/s and 0.8 rad/s", (0.0, -0.8), (0.6, 0.8)),
    ("hardly any reverse", (-0.1, -0.5), (0.5, 1.0)),
    ("faster backwards than forwards", (-0.6, -0.3), (0.2, 1.2)),
    ("turns to one side only", (-0.6, 0.0), (0.6, math.pi / 4)),
    ("turns to one side and hardly to the other", (-0.3, -0.05), (0.6, 1.0)),
):
    for number in range(2):
        BOUNDS.add(
            f"{name}, map {number}",
            on_map,
            "open",
            160 + number,
            problem={"u_min": low, "u_max": high},
            limit=60.0 if low[1] else 30.0,
            quick=name.startswith("hardly") and number == 0,
        )
for number in range(2):
    wheels = {"track": 0.4, "max_wheel_speed": 0.6, "u_min": (-0.6, -3.0), "u_max": (0.6, 3.0)}
    BOUNDS.add(
        f"wheels that saturate together, map {number}",
        on_map,
        "dense",
        164 + number,
        problem=wheels,
        body=Body(0.05, wheels=(0.4, 0.6)),
        quick=number == 0,
    )
    for du_max in ((0.5, 1.5), (0.3, 4.0), (1.0, math.inf)):
        BOUNDS.add(
            f"commands change by {du_max[0]:g} m/s^2 and {du_max[1]:g} rad/s^2, map {number}",
            on_map,
            "dense",
            166 + number,
            problem={"du_max": du_max},
            model="slip",
        )

SHAPES = Table("footprints")
CART, REAR = kl.Footprint.rectangle(0.8, 0.3), kl.Footprint.rectangle(0.7, 0.4, -0.2)
GATE = (kl.Wall(0, -3, 0, -0.3, 0.1), kl.Wall(0, 0.3, 0, 3, 0.1))
WIDE = (kl.Wall(0, -3, 0, -0.45, 0.1), kl.Wall(0, 0.45, 0, 3, 0.1))
NARROW = (kl.Wall(-2.8, 0.3, 0.2, 0.3, 0.1), kl.Wall(-2.8, -0.3, 0.2, -0.3, 0.1))
BEND = (
    kl.Wall(-2, -0.5, 0.95, -0.5, 0.1),
    kl.Wall(0.95, -0.5, 0.95, 2, 0.1),
    kl.Wall(-2, 0.5, -0.05, 0.5, 0.1),
    kl.Wall(-0.05, 0.5, -0.05, 2, 0.1),
)


def cart(
    seed: int, start: Any, goal: Any, walls: Any = (), shape: kl.Footprint = CART, **more: Any
) -> Setup:
    problem = {"footprint": shape, **more.pop("problem", {})}
    return drive(scene(half=3.0, solids=walls), start, goal, seed, problem=problem, **more)


SHAPES.add(
    "0.8 x 0.3 m through a door of 0.5 m", cart, (-1.3, 0.5, 0), (1, -0.5, 0), GATE, quick=True
)
SHAPES.add(
    "the same with its pose at the rear axle",
    cart,
    (-1.3, 0.3, 0),
    (1, -0.5, 0),
    GATE,
    kl.Footprint.rectangle(0.8, 0.3, -0.25),
)
SHAPES.add(
    "a cart backs out of where it cannot turn", cart, (-1, 0, np.pi), (1.5, 0.5, np.pi), NARROW
)
SHAPES.add("a cart backs into where it cannot turn", cart, (1.5, 0.5, 0), (-1, 0, 0), NARROW)
SHAPES.add(
    "a cart drives into a blind alley ahead", cart, (1.5, 0.5, np.pi), (-1, 0, np.pi), NARROW
)
SHAPES.add(
    "a cart rounds the corner of a corridor of 0.9 m",
    cart,
    (-1.3, 0, 0),
    (0.45, 1.4, np.pi / 2),
    BEND,
)
SHAPES.add(
    "a post beside a turning end",
    lambda seed: drive(
        scene((0.0, 0.55, 0.1), half=3.0),
        (0, 0, 0),
        (1.5, 1.0, np.pi / 2),
        seed,
        problem={"footprint": CART},
    ),
)
SHAPES.add(
    "a triangle",
    cart,
    (-1.5, 0.2, 2.0),
    (1.5, -0.4, 1.0),
    WIDE,
    kl.Footprint([(0.3, 0.0), (-0.2, 0.2), (-0.2, -0.2)]),
)
SHAPES.add(
    "a cart that lags stops before a wall",
    cart,
    (-2, 0.5, 0),
    (1, -0.5, 0),
    GATE,
    model="lag",
    body=Body(0.02, lag=0.3, dead_time=0.15),
)
for number in range(3):
    for word, shape in (("cart", CART), ("pose ahead of the middle", REAR)):
        SHAPES.add(
            f"{word} over a large open map {number}",
            on_map,
            "open",
            180 + number,
            by=1.8,
            problem={"footprint": shape},
            limit=80.0,
        )
