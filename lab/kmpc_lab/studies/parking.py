"""Study ``parking``: cars driven to where they park, judged by the true pose and exact outline.

Cars and scenes of their size are drawn at random. How they really move shares no code with the
controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kmpc_lab.studies.drive import DriveResult, drive_past, gaps_of
from kmpc_lab.studies.table import DRIVES, GAP, JERK, TIME, Column, Rows, median_of
from kmpc_lite.control import Controller, Footprint, NavigationProblem, Polygon, Wall
from kmpc_lite.control.path.motions import TURNS, curves
from kmpc_lite.control.wheels import Car
from kmpc_lite.model.koopman import nominal_unicycle
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.types import Array

DT = 0.1  # control period [s]
GAPS = (1.2, 1.25, 1.3, 1.4, 1.5, 1.7, 1.35)
"""Parallel gaps, in lengths of the car; a new one comes last, for a kind's place seeds it."""
THIN = 0.02  # thickness of walls, in lengths of the car
FAR = 4.0  # how far scenes reach, in lengths of the car
TURNED = 0.15  # how far the heading at the start may be wrong [rad]
MOST_TIMES, MOST = 10.0, 60.0
"""A drive ends after so many times the least time, and so many lengths at full speed."""
FEW = 3  # changes of gear that are few
STEERS = 0.35 / 0.6
"""Change of a curvature in a second, times a car's length: 0.35 rad/s by wheels 0.6 lengths apart.
"""


@dataclass(frozen=True)
class DrawnCar:
    """A car; its pose is at the middle of the rear axle."""

    length: float  # [m]
    width: float  # [m]
    overhang: float  # how far it reaches behind the rear axle [m]
    radius: float  # of the tightest circle of the rear axle [m]
    speed: float  # largest speed in either gear [m/s]
    steering_rate: float | None
    """Fastest change of the curvature [1/m per second]; at once if not given."""
    slip: float  # mean of the exponential slip ratios, drawn anew each period
    reverse: bool = True  # whether it may drive backwards

    @property
    def front(self) -> float:
        """How far it reaches ahead of the rear axle [m]."""
        return self.length - self.overhang

    @property
    def footprint(self) -> Footprint:
        """What it covers."""
        return Footprint.rectangle(self.length, self.width, ahead=self.overhang - 0.5 * self.length)

    def problem(self) -> NavigationProblem:
        """Its navigation problem, in an open area."""
        turn_rate = self.speed / self.radius
        return NavigationProblem(
            dt=DT,
            u_min=(-self.speed if self.reverse else 0.0, -turn_rate),
            u_max=(self.speed, turn_rate),
            footprint=self.footprint,
            wheels=Car(self.radius, self.steering_rate),
        )


def random_car(seed: int) -> DrawnCar:
    """Draw a car, from a model of a foot to a lorry of 6 m.

    Turning radii are those of real cars, 0.75 to 1.1 times their length.
    """
    random = np.random.default_rng([seed, 21])
    length = float(np.exp(random.uniform(np.log(0.3), np.log(6.0))))
    radius = length * float(random.uniform(0.75, 1.1))
    lock = float(random.uniform(0.5, 1.5))
    steers_at_once = random.random() < 0.3
    return DrawnCar(
        length,
        length * float(random.uniform(0.4, 0.55)),
        length * float(random.uniform(0.12, 0.25)),
        radius,
        length * float(random.uniform(0.4, 1.2)),
        None if steers_at_once else 2.0 / (radius * lock),
        float(random.uniform(0.0, 0.03)),
    )


class Bicycle:
    """Drives a car by short steps; its wheels stay steered as they are while it stands."""

    def __init__(self, car: DrawnCar, seed: int) -> None:
        self._car, self._random = car, np.random.default_rng([seed, 23])
        self._curvature = 0.0

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        car, h, poses = self._car, DT / LOOKS, np.empty((LOOKS, 3))
        speed, turn_rate = command.tolist()
        sharpest = 1.0 / car.radius
        wanted = turn_rate / speed if abs(speed) > 1e-9 else self._curvature
        wanted = min(max(wanted, -sharpest), sharpest)
        most = math.inf if car.steering_rate is None else car.steering_rate * h
        ahead, aside, turned = car.slip * self._random.exponential(1.0, 3)
        x, y, heading = pose.tolist()
        for k in range(LOOKS):
            self._curvature += min(max(wanted - self._curvature, -most), most)
            driven, left = speed * (1.0 - ahead) * h, speed * aside * h
            turn = driven * self._curvature * (1.0 - turned)
            middle = heading + 0.5 * turn
            x += driven * math.cos(middle) - left * math.sin(middle)
            y += driven * math.sin(middle) + left * math.cos(middle)
            heading += turn
            poses[k] = x, y, heading
        return poses


class Scene(NamedTuple):
    """From where to where, among what."""

    start: Array  # (3,)
    goal: Array  # (3,)
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
    if gaps_of(car.problem(), solids)(start[None])[0] < 0.0:
        start[2] = 0.0  # a long car that is turned would stand in the side of a narrow lane
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


def few_changes(rows: Rows) -> float:
    """Share of the drives that arrived with few changes of gear."""
    return sum(row.arrived and row.gear_changes <= FEW for row in rows) / len(rows)


COLUMNS = (
    *DRIVES,
    TIME,
    Column("changes of gear", ".1f", median_of("gear_changes")),
    Column(f"<= {FEW} changes", ".0%", few_changes),
    JERK,
    GAP,
)
"""The ideal is the quickest curve of Reeds and Shepp, whatever is in its way."""
KINDS_OF_CARS: dict[str, Callable[[DrawnCar], DrawnCar]] = {
    "open, forward only": lambda car: replace(car, reverse=False),
    "open, slow steering": lambda car: replace(car, steering_rate=STEERS / car.length),
}
"""Cars that are driven in the open."""


def least_seconds(car: DrawnCar, start: Array, goal: Array) -> float:
    """Time of the quickest curve of Reeds and Shepp at full speed, and of the steering between.

    A curve that is driven exactly stands where its curvature changes, until the wheels have turned.
    The curves of Dubins that are arc, straight, arc take the place of a car's that only drives
    ahead.
    """
    x, y, turn = goal - start
    cos, sin = math.cos(start[2]), math.sin(start[2])
    seen = (cos * x + sin * y) / car.radius, (cos * y - sin * x) / car.radius, turn
    lengths, turns = (curves(np.array([seen]))[0], TURNS) if car.reverse else ahead(*seen)
    # segments of no length are not steered for
    bends = [some[np.abs(length) > 1e-6] for some, length in zip(turns, lengths, strict=True)]
    jumps = np.array([np.abs(np.diff(some, prepend=0.0)).sum() for some in bends])
    steers = 0.0 if car.steering_rate is None else 1.0 / (car.radius * car.steering_rate)
    driven = np.abs(lengths).sum(axis=1) * car.radius / car.speed
    return float((driven + steers * jumps).min())


def ahead(x: float, y: float, turn: float) -> tuple[Array, Array]:
    """Lengths and turns (W, 3) of Dubins's words to an end, in turning radii."""
    lengths, turns = [], []
    for side in (1.0, -1.0):
        phi, up = side * turn, side * y
        dx, dy = x - math.sin(phi), up - 1.0 + math.cos(phi)
        first = math.atan2(dy, dx) % math.tau
        lengths.append((first, math.hypot(dx, dy), (phi - first) % math.tau))
        turns.append((side, 0.0, side))
        dx, dy = x + math.sin(phi), up - 1.0 - math.cos(phi)
        if (square := dx * dx + dy * dy - 4.0) >= 0.0:
            far = math.sqrt(square)
            first = (math.atan2(dy, dx) + math.atan2(2.0, far)) % math.tau
            lengths.append((first, far, (first - phi) % math.tau))
            turns.append((side, 0.0, -side))
    return np.array(lengths), np.array(turns)


def drive(kind: str, seed: int) -> DriveResult:
    """Draw a car and a scene, and drive."""
    car = random_car(seed)
    if kind in KINDS_OF_CARS:
        car = KINDS_OF_CARS[kind](car)
    return judge(seed, car, scene_of(kind.partition(",")[0], car, seed))


def judge(seed: int, car: DrawnCar, scene: Scene) -> DriveResult:
    """Drive, and judge by the true poses."""
    least = least_seconds(car, scene.start, scene.goal)

    return drive_past(
        Controller(nominal_unicycle(DT), car.problem()),
        Bicycle(car, seed).drive,
        (scene.start, scene.goal),
        scene.solids,
        (least, MOST_TIMES * least + MOST * car.length / car.speed),
    )
