"""Where cars park: scenes of their size, drawn at random."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kmpc_lab.studies.parking.cars import DrawnCar
from kmpc_lite.control import Polygon, Wall
from kmpc_lite.types import Array

GAPS = (1.2, 1.25, 1.3, 1.4, 1.5, 1.7, 1.35)
"""Parallel gaps, in lengths of the car; a new one comes last, for a kind's place seeds it."""
THIN = 0.02
"""Thickness of walls, in lengths of the car."""
FAR = 4.0
"""How far scenes reach, in lengths of the car."""
TURNED = 0.15
"""How far the heading at the start may be wrong [rad]."""


class Scene(NamedTuple):
    """From where to where, among what."""

    start: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    solids: list[Polygon | Wall]


def box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    """Rectangle along the axes."""
    return Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def in_the_open(car: DrawnCar, random: np.random.Generator) -> Scene:
    """A goal 0.3 to 4 lengths away, in any direction and heading."""
    away, course = car.length * random.uniform(0.3, 4.0), random.uniform(-math.pi, math.pi)
    heading = random.uniform(-math.pi, math.pi)
    goal = np.array((away * math.cos(course), away * math.sin(course), heading))
    return Scene(np.array((0.0, 0.0, random.uniform(-math.pi, math.pi))), goal, [])


def along_a_kerb(gap: float, car: DrawnCar, random: np.random.Generator) -> Scene:
    """A gap between two parked cars, on the right of a lane that is 1.2 to 2 lengths wide."""
    length, width = car.length, car.width
    end, deep = gap * length, width * random.uniform(1.2, 1.35)
    lane = length * random.uniform(1.2, 2.0)
    far = FAR * length
    solids: list[Polygon | Wall] = [
        box(-length, -width, 0.0, 0.0),
        box(end, -width, end + length, 0.0),
        Wall(-far, -deep, far + end, -deep, THIN * length),
        Wall(-far, lane, far + end, lane, THIN * length),
    ]
    middle = 0.5 * (end - length)
    # side by side with its neighbours, in the middle of the gap
    goal = np.array((middle + car.overhang, -0.5 * width, 0.0))
    x, y = end + length * random.uniform(-2.5, 0.6), width * random.uniform(0.8, 1.2)
    return Scene(np.array((x, y, random.uniform(-TURNED, TURNED))), goal, solids)


def in_a_bay(car: DrawnCar, random: np.random.Generator) -> Scene:
    """A bay across a lane, to be entered forwards or backwards."""
    length = car.length
    half, deep = 0.5 * car.width * random.uniform(1.3, 1.6), 1.1 * length
    lane = length * random.uniform(1.3, 1.8)
    far = FAR * length
    solids: list[Polygon | Wall] = [
        box(-far, -deep, -half, 0.0),
        box(half, -deep, far, 0.0),
        Wall(-far, -deep, far, -deep, THIN * length),
        Wall(-far, lane, far, lane, THIN * length),
    ]
    backwards = random.random() < 0.5
    middle = -0.5 * deep
    # how far the axle is behind the middle
    behind = 0.5 * length - car.overhang
    goal = (
        (0.0, middle - behind, 0.5 * math.pi)
        if backwards
        else (0.0, middle + behind, -0.5 * math.pi)
    )
    x = length * random.uniform(1.0, 2.5) * random.choice((-1.0, 1.0))
    heading = random.choice((0.0, math.pi)) + random.uniform(-TURNED, TURNED)
    return Scene(np.array((x, lane * random.uniform(0.4, 0.6), heading)), np.array(goal), solids)


def out_of_a_dead_end(car: DrawnCar, random: np.random.Generator) -> Scene:
    """It stands at the end of a corridor, and is to stand on the road behind it."""
    length = car.length
    half, deep = 0.5 * car.width * random.uniform(1.4, 2.0), length * random.uniform(1.5, 2.5)
    road = length * random.uniform(1.4, 2.0)
    far = FAR * length
    solids: list[Polygon | Wall] = [
        box(-far, 0.0, -half, deep),
        box(half, 0.0, far, deep),
        Wall(-far, deep, far, deep, THIN * length),
        Wall(-far, -road, far, -road, THIN * length),
    ]
    start = np.array((0.0, deep - 0.1 * length - car.front, 0.5 * math.pi))
    x = length * random.uniform(1.2, 2.5) * random.choice((-1.0, 1.0))
    goal = np.array((x, -0.5 * road, random.choice((0.0, math.pi))))
    return Scene(start, goal, solids)


def round_in_a_lane(car: DrawnCar, random: np.random.Generator) -> Scene:
    """It turns round in a lane 1.4 to 2 lengths wide."""
    length = car.length
    half, far = 0.5 * length * random.uniform(1.4, 2.0), FAR * length
    solids: list[Polygon | Wall] = [
        Wall(-far, side * half, far, side * half, THIN * length) for side in (-1.0, 1.0)
    ]
    aside = half - 0.5 * car.width - 0.1 * length
    start = np.array((0.0, random.uniform(-1.0, 1.0) * aside, random.uniform(-TURNED, TURNED)))
    x = length * random.uniform(-1.5, 1.5)
    goal = np.array((x, random.uniform(-0.5, 0.5) * aside, math.pi))
    return Scene(start, goal, solids)


Draw = Callable[[DrawnCar, np.random.Generator], Scene]


def _gap(gap: float) -> Draw:
    return lambda car, random: along_a_kerb(gap, car, random)


KINDS: dict[str, Draw] = {
    "open": in_the_open,
    "bay": in_a_bay,
    "dead end": out_of_a_dead_end,
    "lane": round_in_a_lane,
    **{f"gap {gap:g}": _gap(gap) for gap in GAPS},
}
"""Kinds of scenes by their names."""


def scene_of(kind: str, car: DrawnCar, seed: int) -> Scene:
    """Draw a scene of a kind."""
    number = list(KINDS).index(kind)
    return KINDS[kind](car, np.random.default_rng([seed, 22, number]))
