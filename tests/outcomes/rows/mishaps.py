"""Lags, noises, floors, and poses that jump or are lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from outcomes import models
from outcomes.lab import Jumps
from outcomes.plant import Array, Body
from outcomes.rows.build import LAGS, SLIPS, Table, drive, on_map, scene
from outcomes.setup import Setup

POSES = (0.005, 0.02)
LAG = Table("lags and noise")
for number, family in enumerate(("open", "dense", "corridor", "moving")):
    LAG.add(
        f"a robot that lags, {family} map",
        on_map,
        family,
        240 + number,
        model="lag",
        body=LAGS,
        quick=family == "dense",
    )
    LAG.add(
        f"a robot that lags with noisy poses, {family} map",
        on_map,
        family,
        244 + number,
        model="lag, noise",
        body=LAGS,
        noise=POSES,
    )
    LAG.add(
        f"noisy poses, {family} map",
        on_map,
        family,
        248 + number,
        model="noise",
        noise=POSES,
        quick=family == "corridor",
    )
for number in range(2):
    LAG.add(
        f"a robot that lags driven by the nominal model swung about its goal, map {number}",
        on_map,
        "open",
        252 + number,
        body=LAGS,
    )
    LAG.add(
        f"very noisy poses, map {number}",
        on_map,
        "open",
        254 + number,
        model="much noise",
        noise=(0.0125, 0.05),
    )
    LAG.add(
        f"poses 0.1 s old, map {number}",
        on_map,
        "dense",
        256 + number,
        model="noise",
        noise=POSES,
        pose_age=0.1,
        options={"pose_age": 0.1},
    )
    LAG.add(
        f"a robot that lags with noisy poses 0.1 s old, map {number}",
        on_map,
        "open",
        258 + number,
        model="lag, noise",
        body=LAGS,
        noise=POSES,
        pose_age=0.1,
        options={"pose_age": 0.1},
    )
    LAG.add(
        f"poses 0.25 s old, map {number}",
        on_map,
        "open",
        260 + number,
        pose_age=0.25,
        options={"pose_age": 0.25},
    )
TURN_LOSS = 0.06
for number, (lag, dead_time, speed, turn) in enumerate(
    ((0.15, 0.0, 0.6, 1.2), (0.3, 0.1, 0.5, 1.0), (0.1, 0.15, 1.2, 1.8), (0.25, 0.05, 0.9, 1.5))
):
    body = Body(turn_loss=TURN_LOSS, lag=lag, dead_time=dead_time)
    for word, circles in (("straight ahead", ()), ("past a circle", ((3.0 * speed, 0.05, 0.2),))):
        LAG.add(
            f"a robot that loses speed as it turns, learned, {word}, robot {number}",
            lambda seed, body=body, bounds=(speed, turn), circles=circles: drive(
                scene(*circles, half=8.0 * bounds[0]),
                (0, 0, 0),
                (6.0 * bounds[0], 0, 0),
                seed,
                models.learned_body(body, 0.1, bounds, (0.002, 0.004)),
                body,
                problem={"u_min": np.negative(bounds), "u_max": bounds},
            ),
            quick=number == 2,
            chatter=0.15 if circles else 0.05,
        )
for ramp in ((1.0, 1.0), (0.6, 0.8)):
    body = Body(0.05, lag=0.1, dead_time=0.1, ramp=(0.6 / ramp[0], 0.785 / ramp[0]))
    LAG.add(
        f"motors that follow in {ramp[0]:g} s by ramps, learned",
        lambda seed, body=body: on_map(
            seed, "open", 262, body=body, model=models.learned_body(body, 0.1, (0.6, 0.785))
        ),
    )
LAG.add(
    "one minute of a log with 2 cm and 3 degrees of noise",
    lambda seed: on_map(
        seed,
        "open",
        263,
        noise=(0.02, 0.052),
        model=models.learned_body(SLIPS, 0.1, (0.6, 0.785), (0.02, 0.052), 60.0),
    ),
)

FLOOR = Table("floors")
SLIPPERY, TURNS_LESS = ((1.0, 0.2, 1.0),), ((1.0, 0.02, 0.6),)
CHANGES = (
    ("begins to slip by 0.2", SLIPPERY),
    ("turns by 0.6 of the command", TURNS_LESS),
    ("slips by 0.2 and turns by 0.6", ((1.0, 0.2, 0.6),)),
    ("slips by 0.3 and then hardly", ((0.8, 0.3, 1.0), (4.0, 0.01, 1.0))),
)
for number, (word, floors) in enumerate(CHANGES):
    FLOOR.add(
        f"the floor {word}",
        on_map,
        "dense",
        270 + number,
        model="calm",
        body=Body(0.01, floors=floors),
        quick=number == 0,
    )
    FLOOR.add(
        f"the floor {word}, with noisy poses",
        on_map,
        "open",
        274 + number,
        model="noise",
        body=Body(0.03, floors=floors),
        noise=POSES,
    )
    FLOOR.add(
        f"the floor {word}, without adaptation",
        on_map,
        "open",
        278 + number,
        model="calm",
        body=Body(0.01, floors=floors),
        options={"adaptation": False},
    )
FLOOR.add(
    "the floor begins to slip under a robot that lags",
    on_map,
    "open",
    282,
    model="lag",
    body=Body(0.02, lag=0.3, dead_time=0.15, floors=SLIPPERY),
)
for word, point in (("ahead", (0.05, 0.02)), ("back", (-0.04, 0.0))):
    for number in range(2):
        FLOOR.add(
            f"turning centre {word} of the pose, map {number}",
            on_map,
            "open",
            283 + number,
            model=f"turning {word}",
            body=Body(0.03, turning_point=point),
            quick=(word, number) == ("ahead", 0),
        )
FLOOR.add(
    "skid-steer that turns by half, nominal model", on_map, "open", 286, body=Body(0.02, (1, 0.5))
)
FLOOR.add(
    "wheels that are blocked for two seconds",
    on_map,
    "open",
    287,
    body=Body(0.05, blocked=(1.5, 3.5)),
)
FLOOR.add(
    "wheels that are blocked for six seconds",
    on_map,
    "open",
    288,
    body=Body(0.05, blocked=(1.5, 7.5)),
)
FLOOR.add("a robot that draws to one side", on_map, "open", 289, body=Body(0.02, draws=0.2))
FLOOR.add("a slope of 2 cm/s", on_map, "open", 290, body=Body(0.02, slope=(0.0, -0.02)))
FLOOR.add(
    "a slope of 6 cm/s never lets it come to rest",
    on_map,
    "open",
    290,
    body=Body(0.02, slope=(0.0, -0.06)),
    limit=30.0,
)
FLOOR.add(
    "a robot of another model: it turns the other way",
    on_map,
    "open",
    291,
    body=Body(0.02, (1.0, -1.0)),
    limit=20.0,
    right="waiting",
)

POSE = Table("poses")
FREE = ((0, 0, 0), (1.8, 0, 0))


def wrong(seed: int, measure: Callable[[int, Array], Array], *circles: Any, **more: Any) -> Setup:
    return drive(scene(*circles), *FREE, seed, measure=measure, **more)


def jump(x: float, y: float, turn: float, first: int, after: int) -> Callable[[int, Array], Array]:
    """The pose is wrong by this from one step until another."""
    off = np.array([x, y, turn])
    return lambda k, pose: pose + off if first <= k < after else pose


def lost(first: int, after: int) -> Callable[[int, Array], Array]:
    """There is no pose from one step until another."""
    return lambda k, pose: np.full(3, np.nan) if first <= k < after else pose


class Frozen:
    """The pose stays as it was from one step until another."""

    def __init__(self, first: int, after: int) -> None:
        self._steps, self._pose = range(first, after), np.zeros(3)

    def __call__(self, k: int, pose: Array) -> Array:
        if k not in self._steps:
            self._pose = pose
        return self._pose


POSE.add("an outlier of 0.3 m costs one period", wrong, jump(0.3, 0, 0, 12, 13), quick=True)
POSE.add("an outlier of half a radian", wrong, jump(0, 0, 0.5, 12, 13))
POSE.add(
    "the pose is wrong by 0.3 m for a second", wrong, jump(0.3, 0.1, 0, 12, 22), (1.0, 0.5, 0.2)
)
POSE.add(
    "the heading is wrong by 0.5 rad for a second", wrong, jump(0, 0, 0.5, 12, 22), (1.0, -0.5, 0.2)
)
POSE.add(
    "the pose is lost for one step beside a jump",
    lambda seed: wrong(
        seed, lambda k, p: np.full(3, np.nan) if k == 13 else jump(1, 0.5, 0.3, 12, 30)(k, p)
    ),
)
POSE.add("the pose is lost for half a second", wrong, lost(12, 17), (1.0, 0.5, 0.2), quick=True)
POSE.add("the pose is lost for five seconds", wrong, lost(12, 62), (1.0, 0.5, 0.2))
POSE.add(
    "the pose is frozen for half a second",
    lambda seed: wrong(seed, Frozen(12, 17), (1.0, 0.5, 0.2)),
)
POSE.add(
    "the pose is frozen for three seconds",
    lambda seed: wrong(seed, Frozen(12, 42), (1.0, 0.5, 0.2)),
)
POSE.add("every third pose is lost", wrong, lambda k, p: np.full(3, np.nan) if k % 3 == 2 else p)
POSE.add("whole turns in the heading", wrong, lambda k, p: p + (0, 0, 2 * math.pi * (k % 5 - 2)))
POSE.add(
    "one coordinate is infinite for a step", wrong, lambda k, p: p + (0, np.inf if k == 9 else 0, 0)
)


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


for number, (kind, size) in enumerate(
    (
        ("one sample", 0.3),
        ("a second", 0.05),
        ("a second", 0.3),
        ("a second", 1.0),
        ("heading", 0.3),
        ("for good", 0.1),
        ("for good", 0.3),
    )
):
    POSE.add(f"jumps again and again: {kind}, {size:g}", jumping, kind, size, 294 + number)
POSE.add(
    "carried aside, turned and pushed",
    on_map,
    "open",
    302,
    model="slip",
    kicks={10: (0.0, 0.09, 0.0), 20: (0.12, -0.1, 0.4), 42: (0.0, 0.0, 2.5)},
)
POSE.add(
    "carried half a metre",
    lambda seed: drive(scene((0.5, 1.2, 0.2)), *FREE, seed, kicks={15: (-0.3, 0.45, -1.3)}),
)
POSE.add(
    "pushed off its goal it drives back",
    lambda seed: drive(
        scene(), (0, 0, 0), (0.5, 0, 0), seed, kicks={60: (0.1, 0.15, 0.5)}, least=7.0, limit=30.0
    ),
    quick=True,
)
