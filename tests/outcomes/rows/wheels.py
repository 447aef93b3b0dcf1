"""Cars and omnis: in the open, among circles, in lanes and bays, by gears and sideways."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes.plant import Array
from outcomes.rows.build import Table, drive, on_map, scene
from outcomes.setup import NO_CIRCLES, Scene, Setup
from outcomes.steered import Bicycle, Mecanum, Rollers, Steering

CARS, OMNIS = Table("cars"), Table("omnis")
RADIUS = 0.4
CAR = {"u_min": (-0.6, -1.5), "u_max": (0.6, 1.5), "wheels": kl.Car(RADIUS)}
SLOW_SERVO = {**CAR, "wheels": kl.Car(RADIUS, steering_rate=5.0)}
FORWARD = {**CAR, "wheels": kl.Car(RADIUS, reverse=False)}
CART = kl.Footprint.rectangle(0.5, 0.25, ahead=-0.15)
LONG = {**CAR, "footprint": CART}
EVEN, SLIPS = Steering(1.0 / RADIUS), Steering(1.0 / RADIUS, slip=0.03)
SERVO = Steering(1.0 / RADIUS, rate=5.0, lag=0.1, slip=0.02)
OMNI = {"wheels": kl.Omni()}
FAMILIES = ("open", "dense", "walls")
ROLLS = Rollers(gains=(1.0, 0.9, 1.0), slip=0.03)


def car(seed: int, around: Scene, start: Any, goal: Any, steering: Steering, **more: Any) -> Setup:
    more = {"problem": CAR, "limit": 60.0, **more}
    return drive(around, start, goal, seed, plant=Bicycle(steering, 0.1, [seed, 3]), **more)


def omni(seed: int, around: Scene, start: Any, goal: Any, **more: Any) -> Setup:
    model, plant = kl.nominal_omni(0.1), Mecanum(ROLLS, 0.1, [seed, 3])
    more = {"problem": OMNI, "limit": 40.0, **more}
    return drive(around, start, goal, seed, model=model, plant=plant, **more)


def poses(number: int, half: float = 1.4) -> tuple[Array, Array]:
    random = np.random.default_rng([number, 33])
    size = (half, half, math.pi)
    return random.uniform(-1, 1, 3) * size, random.uniform(-1, 1, 3) * size


def free(seed: int, make: Any, number: int, *arguments: Any, **more: Any) -> Setup:
    """Drive from any pose to any other."""
    found: Setup = make(seed, scene(half=2.5), *poses(number), *arguments, **more)
    return found


def mapped(seed: int, number: int, kind: str, problem: dict[str, Any]) -> Setup:
    """Drive over a random map."""
    model, plant = "nominal", Bicycle(SLIPS, 0.1, [seed, 3])
    if kind == "omnis":
        model, plant = kl.nominal_omni(0.1), Mecanum(ROLLS, 0.1, [seed, 3])
    family = FAMILIES[number % 3]
    return on_map(seed, family, number, problem=problem, model=model, plant=plant)


for number in range(6):
    CARS.add(f"a car in the open {number}", free, car, number, SLIPS, quick=number == 0)
    OMNIS.add(f"an omni in the open {number}", free, omni, number, quick=number == 0)
    CARS.add(f"a car past circles {number}", mapped, number, "cars", CAR, quick=number == 1)
    OMNIS.add(f"an omni past circles {number}", mapped, number, "omnis", OMNI, quick=number == 1)
for number in range(3):
    CARS.add(f"a car with a slow servo {number}", free, car, number, SERVO, problem=SLOW_SERVO)
    CARS.add(f"a car without reverse gear {number}", free, car, number, SLIPS, problem=FORWARD)


def slot(gap: float) -> tuple[Scene, tuple[float, float, float]]:
    """Two parked ones along a kerb, and the pose between them."""
    length = 0.5 * gap
    solids = [
        kl.Polygon([(-1.0, -0.3), (0.0, -0.3), (0.0, 0.0), (-1.0, 0.0)]),
        kl.Polygon([(length, -0.3), (length + 1, -0.3), (length + 1, 0.0), (length, 0.0)]),
        kl.Wall(-1.0, -0.36, length + 1, -0.36, 0.02),
    ]
    return scene(solids=solids), (0.5 * length - 0.15, -0.16, 0.0)


def parallel(seed: int, gap: float, start: Any, out: bool = False) -> Setup:
    around, goal = slot(gap)
    begin, end = (goal, start) if out else (start, goal)
    return car(seed, around, begin, end, EVEN, problem=LONG)


for gap in (1.3, 1.4, 1.5, 1.7, 2.0):
    CARS.add(f"parks along a kerb, {gap} times its length", parallel, gap, (1.2, 0.3, 0.0))
CARS.add("leaves a gap along a kerb", parallel, 1.6, (1.4, 0.3, 0.0), True)


def bay(seed: int, heading: float, width: float, make: Any = car, *arguments: Any) -> Setup:
    """A bay across the lane, to be entered forwards or backwards."""
    half = 0.5 * width
    solids = [
        kl.Polygon([(-1.8, -0.8), (-half, -0.8), (-half, 0.0), (-1.8, 0.0)]),
        kl.Polygon([(half, -0.8), (1.8, -0.8), (1.8, 0.0), (half, 0.0)]),
        kl.Wall(-1.8, 0.9, 1.8, 0.9, 0.02),
    ]
    place = -0.5 if heading > 0.0 else -0.2
    problem = {**(CAR if make is car else OMNI), "footprint": CART}
    goal = (0.0, place, heading)
    found: Setup = make(
        seed, scene(solids=solids), (-1.0, 0.4, 0.0), goal, *arguments, problem=problem
    )
    return found


CARS.add("parks in a bay, backwards", bay, 0.5 * math.pi, 0.5, car, EVEN, quick=True)
CARS.add("parks in a bay, forwards", bay, -0.5 * math.pi, 0.5, car, EVEN)
OMNIS.add("an omni in a bay, backwards", bay, 0.5 * math.pi, 0.5, omni)
OMNIS.add("an omni in a bay, forwards", bay, -0.5 * math.pi, 0.5, omni)


def lane(seed: int, half: float) -> Setup:
    """Turn round in a lane."""
    solids = [kl.Wall(-2, y, 2, y, 0.02) for y in (-half, half)]
    return car(seed, scene(solids=solids), (-0.5, 0, 0), (0.5, 0, math.pi), EVEN)


CARS.add("turns round in a lane by changes of gear", lane, 0.55)
CARS.add("turns round in a narrower lane", lane, 0.42)


CART_RADIUS, CART_SPEED = 2.64, 2.5
GOLF_CART = {
    "horizon": 30,
    "u_min": (-1.0, -CART_SPEED / CART_RADIUS),
    "u_max": (CART_SPEED, CART_SPEED / CART_RADIUS),
    "du_max": (2.0, math.inf),
    "footprint": kl.Footprint.rectangle(2.4, 1.2, ahead=0.825),
    "wheels": kl.Car(CART_RADIUS),
    "goal_tolerance": (0.2, 0.1),
}


def corridor(seed: int, width: float, bend: float, **options: Any) -> Setup:
    """A corridor with two bends, for a golf cart whose motor lags more than its model knows."""
    random = np.random.default_rng([seed, round(100 * width)])
    first, second = random.uniform(8.0, 12.0, 2).tolist()
    steps = [(4.0 + first, 0.0), (second, bend), (8.0, 0.0)]
    moves = [(d * math.cos(a), d * math.sin(a)) for d, a in steps]
    line = np.array([(-4.0, 0.0), *moves]).cumsum(axis=0)
    # walls meet on the bisectors
    aside = [(0.0, 1.0), *2 * [(-math.tan(0.5 * bend), 1.0)], (0.0, 1.0)]
    sides = [line + 0.5 * sign * width * np.array(aside) for sign in (1, -1)]
    solids = [kl.Wall(*a, *b, 0.05) for side in sides for a, b in zip(side, side[1:], strict=False)]
    around = Scene((-5.0, -25.0, 35.0, 25.0), NO_CIRCLES, tuple(solids))
    goal = (line[3, 0] - 5.0, line[3, 1], 0.0)
    steering = Steering(1.0 / CART_RADIUS, rate=0.8, lag=0.34)
    more = {"problem": GOLF_CART, "options": options, "tolerance": (0.3, 0.2)}
    return car(seed, around, (0, 0, 0), goal, steering, **more)


for width, bend in ((2.2, 0.7), (2.5, -0.5), (2.8, 0.9)):
    CARS.add(f"a golf cart in a corridor of {width} m", corridor, width, bend)
CARS.add("a golf cart in a corridor, adapted", corridor, 2.6, -0.8, adaptation=True)
CARS.add("a golf cart that rolled into a wall", lambda _: corridor(7, 2.5, -0.9), quick=True)


def told(seed: int) -> Setup:
    """A lane in which a car without reverse gear cannot turn."""
    solids = [kl.Wall(-2, y, 2, y, 0.02) for y in (-0.25, 0.25)]
    around, goal = scene(solids=solids), (1.0, 0.0, math.pi)
    return car(seed, around, (-1, 0, 0), goal, EVEN, problem=FORWARD, limit=30.0)


CARS.add("no room to turn is told", told, right="unreachable")


def sideways(seed: int, width: float) -> Setup:
    """Through a gap that is narrower than the robot is long: sideways."""
    half = 0.5 * width
    solids = [kl.Wall(-2, 0, -half, 0, 0.02), kl.Wall(half, 0, 2, 0, 0.02)]
    problem = {**OMNI, "footprint": kl.Footprint.rectangle(0.6, 0.3)}
    return omni(seed, scene(solids=solids), (0, -1, 1.57), (0, 1, 1.57), problem=problem)


for width in (0.6, 0.5):
    OMNIS.add(f"an omni through a gap of {width} m", sideways, width)
OMNIS.add(
    "an omni past someone who crosses",
    omni,
    scene((0.0, 1.2, 0.2, 0.0, -0.3)),
    (-1.5, 0, 0),
    (1.5, 0, 0),
)
CARS.add(
    "a car past someone who crosses",
    car,
    scene((0.0, 1.2, 0.2, 0.0, -0.3), half=2.5),
    (-1.5, 0, 0),
    (1.5, 0, 0),
    SLIPS,
)
