"""Circles that move: as they say, otherwise, and pedestrians who ignore the robot."""

from __future__ import annotations

from typing import Any

import numpy as np

from outcomes import sensing
from outcomes.lab import Pedestrians, Walks
from outcomes.plant import Array
from outcomes.rows.build import LAGS, Table, drive, on_map, scene
from outcomes.setup import Scene, Setup

MOVING = Table("moving")
MIDDLE = ((-1.5, 0, 0), (1.5, 0, 0))


def past(seed: int, *circles: Any, ends: Any = MIDDLE, **more: Any) -> Setup:
    return drive(scene(*circles), *ends, seed, more.pop("model", "slip"), **more)


for number in range(4):
    MOVING.add(
        f"crossing circles, map {number}",
        on_map,
        "moving",
        220 + number,
        model="slip",
        quick=number == 0,
    )
    MOVING.add(
        f"crossing circles whose velocities are unknown, map {number}",
        on_map,
        "moving",
        224 + number,
        sense=sensing.NoisyRows(),
    )
for number in range(2):
    MOVING.add(
        f"crossing circles, a robot that lags, map {number}",
        on_map,
        "moving",
        228 + number,
        model="lag",
        body=LAGS,
    )
MOVING.add(
    "crossing circles through a tracker",
    lambda seed: on_map(seed, "moving", 230, sense=sensing.Tracked(0.1)),
)
for x in (-0.4, 0.0, 0.4):
    MOVING.add(
        f"a crossing circle from {x:g} m is let pass",
        past,
        (x, 1.0, 0.25, 0.0, -0.3),
        quick=x == 0.0,
    )
for vx, vy in ((0.0, -0.2), (-0.2, 0.0), (-0.15, -0.2)):
    MOVING.add(
        f"a parked robot makes room for ({vx:g}, {vy:g}) m/s and comes back",
        past,
        (-8 * vx, -8 * vy, 0.2, vx, vy),
        ends=((0, -0.5, 0), (0, 0, 0)),
        least=18.0,
        limit=40.0,
        quick=vy == 0.0,
    )
for vx, vy in ((-0.03, 0.0), (0.0, 0.04), (0.02, 0.0), (0.007, 0.007)):
    MOVING.add(
        f"a circle that creeps at ({vx:g}, {vy:g}) m/s through the way is driven around",
        past,
        (0.0, 0.0, 0.35, vx, vy),
        ends=((-1.2, 0, 0), (1.5, 0, 0)),
        quick=vy == 0.04,
    )
POSTS = [(0.0, s * y, 0.2) for s in (1, -1) for y in np.arange(0.6, 2.1, 0.3)]
MOVING.add(
    "a circle that creeps through the only passage is waited for",
    past,
    (0.0, 0.35, 0.1, 0.0, -0.05),
    *POSTS,
    ends=((-1.2, 0, 0), (1.5, 0, 0)),
)
MOVING.add(
    "a circle that stands in the only way and moves off",
    past,
    (0.0, 0.0, 0.15, 0.0, 0.12),
    *[p for p in POSTS if abs(p[1]) > 0.5],
)
for number, (place, velocity) in enumerate(
    (((-3.0, 0.05), (0.35, 0.0)), ((-1.6, -1.5), (0.15, 0.25)), ((0.5, 1.8), (-0.25, -0.3)))
):
    MOVING.add(
        f"a robot is chased by a circle, {number}", past, (*place, 0.15, *velocity), ends=MIDDLE
    )
    MOVING.add(
        f"a robot that lags is chased by a circle, {number}",
        past,
        (*place, 0.15, *velocity),
        ends=MIDDLE,
        model="lag",
        body=LAGS,
    )


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
            for place in places:
                row = now.copy()
                row[:, :2] = place
                self._rows.append(row)
        return self._rows[number].copy()


def walker(seed: int, path: Path, sense: Any, *circles: Any, ends: Any, **more: Any) -> Setup:
    place = Scene((-3.0, -3.0, 3.0, 3.0), scene(*circles).circles, movers=path)
    sense = sense() if isinstance(sense, type) else sense
    return drive(place, *ends, seed, sense=sense, **more)


PEOPLE = Table("pedestrians")
ACROSS = ((0, 0, 0), (1.8, 0, 0))
for word, sense in (
    ("said to stand", sensing.said_to_stand),
    ("seen by lidar", sensing.Scanner),
    ("seen with noise", sensing.NoisyRows),
):
    for speed in (0.3, 0.7, 1.0):
        PEOPLE.add(
            f"one who walks across at {speed:g} m/s, {word}",
            walker,
            Path([(0.9, -2.0 * speed), (0.9, 3.0)], speed),
            sense,
            ends=ACROSS,
            quick=(word, speed) == ("said to stand", 0.7),
        )
    PEOPLE.add(
        f"one who turns round is not crept up to, {word}",
        walker,
        Path([(-0.5, 1.5), (0.8, 1.5), (0.0, 0.3), (2.0, -1.0)], 0.9, 0.25),
        sense,
        ends=ACROSS,
        quick=word == "seen by lidar",
    )
    PEOPLE.add(
        f"one who comes straight to the robot and turns off, {word}",
        walker,
        Path([(2.8, 0.0), (0.9, 0.0), (0.9, -2.5)], 0.6, 0.25),
        sense,
        ends=ACROSS,
    )
    PEOPLE.add(
        f"one who stops in the way and goes on, {word}",
        walker,
        Path([(0.9, -1.4), (0.9, -0.1), (0.9001, -0.1), (0.9, 2.5)], 0.5),
        sense,
        ends=ACROSS,
    )
PEOPLE.add(
    "one who is hidden by a post while it walks, seen by lidar",
    walker,
    Path([(1.0, 2.2), (1.0, -2.5)], 0.7, 0.2),
    sensing.Scanner,
    (0.75, 0.55, 0.12),
    ends=ACROSS,
)


def among(seed: int, number: int, count: int, turning: bool, sense: Any, dt: float = 0.1) -> Setup:
    """Across an area of 6 m among people."""
    random, half = np.random.default_rng([number, seed, 81]), 3.0
    side = float(random.choice([-1.0, 1.0]))
    start = (-2.2 * side, float(random.uniform(-2, 2)), float(random.uniform(-3, 3)))
    goal = (2.2 * side, float(random.uniform(-2, 2)), float(random.uniform(-3, 3)))
    walks = Walks(count, turning)
    crowd = Crowd(walks, 3_000 + number + 100 * seed, np.array(start[:2]), dt, 10)
    sense = sense() if isinstance(sense, type) else sense
    place = Scene((-half, -half, half, half), movers=crowd)
    return drive(place, start, goal, seed, sense=sense, limit=60.0, tolerance=(0.05, 0.15))


WORDS: dict[str, Any] = {
    "told": sensing.known,
    "said to stand": sensing.said_to_stand,
    "noisy": sensing.NoisyRows,
    "lidar": sensing.Scanner,
}
for word, sense in WORDS.items():
    for number, (count, turning) in enumerate(((4, False), (4, True), (8, False))):
        PEOPLE.add(
            f"{count} people who walk {'arcs' if turning else 'straight'}, {word}",
            among,
            number,
            count,
            turning,
            sense,
            touches=True,
        )
