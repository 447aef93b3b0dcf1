"""Circles that are revealed within a reach, and robots with real accelerations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from outcomes import models
from outcomes.plant import Array, Body
from outcomes.rows.build import SLIPS, Table, drive, on_map, scattered
from outcomes.sensing import Within
from outcomes.setup import Scene, Setup

REVEALED = Table("revealed")
for speed in (0.6, 1.5):
    for reach in (2.0, 1.0, 0.5, 0.3):
        for number in range(2 if speed > 1.0 else 1):
            turn = math.pi / 4 * speed / 0.6
            REVEALED.add(
                f"{speed:g} m/s, circles revealed at {reach:g} m, map {number}",
                on_map,
                "open",
                200 + number,
                sense=Within(reach),
                problem={
                    "u_min": (-speed, -turn),
                    "u_max": (speed, turn),
                    "du_max": (1.5, 5.0),
                    "sensor_range": reach,
                },
                limit=60.0,
                quick=(speed, reach, number) == (1.5, 1.0, 0),
            )
for number in (0, 1):
    REVEALED.add(
        f"circles revealed at 0.5 m on a dense map {number}: one behind was forgotten",
        on_map,
        "dense",
        204 + number,
        sense=Within(0.5),
        problem={"sensor_range": 0.5},
    )
REVEALED.add(
    "circles revealed at 0.5 m in a trap",
    on_map,
    "trap",
    206,
    sense=Within(0.5),
    problem={"sensor_range": 0.5},
    limit=90.0,
)

RAMPS = Table("accelerations")


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
    count = int(random.integers(15, 26))
    rows: Array = scattered(
        random, 0.85 * half, count, (radius, 0.06 * side), 3.0 * radius, (start, goal)
    )
    turn = min(math.pi / 4 * speed / 0.6, 2.0)
    body = Body(SLIPS.slip, ramp=ramp)
    problem: dict[str, Any] = {
        "robot_radius": radius,
        "u_min": (-speed, -turn),
        "u_max": (speed, turn),
    }
    model: Any = "nominal"
    if knows == "given":
        problem |= {"du_max": ramp, "deceleration": ramp}
    elif knows == "learned":
        model = models.learned_body(body, 0.1, (speed, turn))
    if reach:
        problem["sensor_range"] = reach
    more: dict[str, Any] = {"sense": Within(reach)} if reach else {}
    return drive(
        Scene((-half, -half, half, half), rows),
        start,
        goal,
        seed,
        model,
        body,
        problem=problem,
        limit=5.0 * side / speed + 20.0,
        **more,
    )


for speed, ramp, side in (
    (0.6, (0.4, 2.0), 8.0),
    (1.5, (1.5, 5.0), 8.0),
    (3.0, (1.0, 3.0), 24.0),
    (1.0, (0.5, 1.5), 8.0),
):
    for knows in ("given", "learned"):
        for number in range(2):
            RAMPS.add(
                f"{speed:g} m/s and {ramp[0]:g} m/s^2, {knows}, field {number}",
                fast_field,
                number,
                speed,
                ramp,
                side,
                knows,
                quick=(speed, knows, number) == (1.5, "given", 0),
            )
for speed, ramp, side in ((0.6, (0.4, 2.0), 8.0), (1.5, (1.5, 5.0), 8.0), (3.0, (1.0, 3.0), 24.0)):
    for reach in (2.0, 0.85):
        RAMPS.add(
            f"{speed:g} m/s and {ramp[0]:g} m/s^2, learned, revealed at {reach:g} m",
            fast_field,
            2,
            speed,
            ramp,
            side,
            "learned",
            reach,
        )
RAMPS.add(
    "1.5 m/s and 1.5 m/s^2 that the controller does not know of",
    fast_field,
    3,
    1.5,
    (1.5, 5.0),
    8.0,
    "nothing",
)
