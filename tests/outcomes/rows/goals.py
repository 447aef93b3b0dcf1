"""Goals: parking in every pose, goals that change, that cannot be reached, between obstacles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes.plant import Body
from outcomes.rows.build import LAGS, Table, drive, on_map, scene
from outcomes.setup import Setup

PARK = Table("parking")
OPEN = (0.0, 0.0, 0.0)


def park(seed: int, number: int, **more: Any) -> Setup:
    """From within 0.6 m of the goal, whichever way both face."""
    random = np.random.default_rng([number, 91])
    bearing, away = random.uniform(-math.pi, math.pi), 0.6 * math.sqrt(random.uniform())
    start = (away * math.cos(bearing), away * math.sin(bearing), random.uniform(-3, 3))
    goal = (0.0, 0.0, random.uniform(-3, 3))
    return drive(scene(), start, goal, seed, limit=40.0, **{"model": "slip", **more})


for number in range(6):
    PARK.add(f"parks from beside its goal {number}", park, number, quick=number == 1)
for number in range(2):
    PARK.add(
        f"parks with noisy poses {number}", park, 10 + number, model="noise", noise=(0.005, 0.02)
    )
    PARK.add(f"parks although it lags {number}", park, 12 + number, model="lag", body=LAGS)
    PARK.add(
        f"parks although it lags, nominal model {number}",
        park,
        14 + number,
        model="nominal",
        body=LAGS,
    )
    PARK.add(
        f"parks by commands that change slowly {number}",
        park,
        16 + number,
        problem={"du_max": (0.5, 2.0)},
    )
    PARK.add(
        f"parks on a floor that slips by 0.2 {number}",
        park,
        18 + number,
        model="slippery",
        body=Body(slip=0.2),
    )
    PARK.add(f"parks forward only {number}", park, 20 + number, problem={"u_min": (0.0, -0.8)})
    PARK.add(
        f"parks within 5 cm and 0.15 rad {number}",
        park,
        22 + number,
        problem={"goal_tolerance": (0.05, 0.15)},
        tolerance=(0.05, 0.15),
    )

GOALS = Table("goals")


def to(seed: int, goal: Any, *circles: Any, start: Any = OPEN, **more: Any) -> Setup:
    return drive(scene(*circles), start, goal, seed, **more)


for number, goal in enumerate(((2.6, 0.0, 0.0), (0.0, 3.5, 1.57), (2.5, 2.5, 0.8))):
    GOALS.add(
        f"a goal outside the area is told, {number}",
        to,
        goal,
        limit=20.0,
        right="unreachable",
        quick=number == 0,
    )
GOALS.add(
    "a goal 50 m outside pulls nobody out",
    to,
    (50.0, 30.0, 0.0),
    start=(1.9, 0, 0),
    limit=20.0,
    right="unreachable",
)
GOALS.add("a robot outside its area comes back", to, OPEN, start=(2.6, 2.3, 0.4))
GOALS.add(
    "a goal inside an obstacle is told",
    to,
    (1.0, 0.2, 0),
    (1.0, 0.2, 0.2),
    limit=15.0,
    right="unreachable",
    quick=True,
)
RING = [(0.7 * math.cos(a), 0.7 * math.sin(a), 0.2) for a in np.arange(16) * math.pi / 8]
GOALS.add(
    "a goal in a closed ring is told",
    to,
    (0, 0, 1.0),
    *RING,
    start=(-1.5, -1.5, 0),
    limit=15.0,
    right="unreachable",
)


def opening(seed: int) -> Setup:
    """Three circles of the ring go after five seconds."""
    setup = to(seed, (0, 0, 1.0), *RING[3:], start=(-1.5, -1.5, 0))
    setup.scene.visits = tuple((0.0, 5.0, (*row, 0.0, 0.0)) for row in RING[:3])
    setup.least = 6.0
    return setup


GOALS.add("a robot waits outside a ring until it opens", opening)


def freed(seed: int) -> Setup:
    """The circle on the goal is taken away after two seconds."""
    setup = to(seed, (1.0, 0.2, 0.0))
    setup.scene.visits = ((0.0, 2.0, (1.0, 0.2, 0.2, 0.0, 0.0)),)
    setup.least = 3.0
    return setup


GOALS.add("a goal inside an obstacle that is taken away", freed)
for radius in (0.1, 1.0):
    for heading in (0.0, math.pi / 2):
        away = 0.15 + radius + 0.015
        GOALS.add(
            f"a goal between circles of {radius:g} m with 1.5 cm to spare, heading {heading:.1f}",
            to,
            (1, 0, heading),
            (1, away, radius),
            (1, -away, radius),
            start=(-1.5, 0.3, 1),
            quick=(radius, heading) == (0.1, 0.0),
        )
GOALS.add(
    "a goal with less to spare than the solver's margin",
    to,
    (1, 0, 0.0),
    (1, 0.253, 0.1),
    (1, -0.253, 0.1),
    start=(-1.5, 0.3, 1),
    limit=20.0,
    right="arrived/holding/unreachable/waiting",
)
GOALS.add("a goal 11 mm beside a wall's margin", to, (1.0, 0.0, 1.57), (1.0, 0.38, 0.2))
GOALS.add("starts at its goal", to, OPEN, quick=True)
GOALS.add("turns on the spot at its goal", to, (0.0, 0.0, 3.0), (0.0, 0.4, 0.15))
GOALS.add(
    "a far goal behind an obstacle",
    lambda seed: drive(scene((0.0, 1.0, 0.2), half=100.0), (0, 0.05, 1.57), (0, 12.0, 1.57), seed),
)
for number, x in enumerate((0.46, 0.40)):
    GOALS.add(
        f"starts within a circle and leaves outwards {number}",
        to,
        (-1, 0, 0),
        (0, 0, 0.3),
        start=(x, 0.02, math.pi / 2),
        touches=True,
        model="slip",
    )
GOALS.add(
    "starts on a circle's centre",
    to,
    (1.5, 1.5, 0),
    (0.3, 0.3, 0.2),
    start=(0.3, 0.3, 0.2),
    touches=True,
)
GOALS.add(
    "touches one circle and does not retreat into a wall",
    lambda seed: drive(
        scene((0.33, 0.0, 0.2), solids=[kl.Wall(-0.25, -1.0, -0.25, 1.0, 0.1)]),
        OPEN,
        (0.0, 1.2, 1.57),
        seed,
    ),
    touches=True,
)


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


GOALS.add("a new goal every second and a half", tour, 380, 6, 1.5)
GOALS.add("a new goal every six seconds", tour, 381, 5, 6.0, quick=True)
GOALS.add(
    "a new goal every four seconds for a robot that lags", tour, 382, 5, 4.0, model="lag", body=LAGS
)


def stalled_before(seed: int) -> Setup:
    """What was tried on the way to one goal took the longer side to the next."""
    setup = to(seed, (1.2, 0.0, 0.0), (1.2, 0.0, 0.3), (0.3, 0.6, 0.25), start=(-0.5, 0.6, 0.0))
    setup.goals = ((8.0, np.array((1.0, 1.2, 0.0))),)
    return setup


GOALS.add("what was tried for one goal does not count for the next", stalled_before)


def appears(seed: int, distance: float, radius: float) -> Setup:
    """A circle appears before the robot at full speed."""
    setup = to(seed, (1.8, 0, 0), start=(-1.8, 0, 0), model="slip")
    x = -1.8 + 0.6 * 1.8 + 0.15 + radius + distance
    setup.scene.visits = ((2.0, 1e9, (x, 0.03, radius, 0.0, 0.0)),)
    return setup


for distance in (0.5, 0.3, 0.22):
    GOALS.add(
        f"a circle appears {distance:g} m ahead at full speed",
        appears,
        distance,
        0.2,
        quick=distance == 0.3,
    )


def bad_numbers(seed: int, kind: str) -> Setup:
    """Obstacles or goals that are no numbers for a while."""
    setup = on_map(seed, "open", 385, model="slip")
    right = setup.sense

    def sense(moment: Any) -> Any:
        if 12 <= moment.number < 18 and kind == "circle":
            return np.array([[np.nan, 0.0, 0.2, 0.0, 0.0]])
        if 12 <= moment.number < 18 and kind == "many":
            return np.tile((1.9, 1.9, 0.05, 0.0, 0.0), (20_000, 1))
        return right(moment)

    setup.sense = sense
    if kind == "goal":
        setup.goals = ((1.2, np.full(3, np.nan)), (1.8, setup.goal))
    return setup


for kind in ("circle", "goal", "many"):
    GOALS.add(f"a {kind} that is not usable for half a second stops and goes on", bad_numbers, kind)

FAR = Table("frames")
for word, off in (("9 km from the origin", (9_000.0, -5_000.0)), ("turned maps", (0.0, 0.0))):
    for number in range(2):

        def moved(seed: int, number: int = number, off: Any = off) -> Setup:
            setup = on_map(seed, "open", 390 + number)
            x, y = off
            bounds = (x - 2.0, y - 2.0, x + 2.0, y + 2.0)
            rows = setup.scene.circles + (x, y, 0.0, 0.0, 0.0)
            turn = 0.0 if x else 14.0 * math.pi
            at = [pose + (x, y, turn) for pose in (setup.start, setup.goal)]
            return drive(scene(*rows, bounds=bounds), *at, seed)

        FAR.add(f"{word}, map {number}", moved, quick=bool(off[0]) and number == 0)
