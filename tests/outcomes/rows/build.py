"""How rows are put together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models, sensing
from outcomes.lab import Scenario, random_map
from outcomes.plant import Array, Body, Vehicle
from outcomes.setup import NO_CIRCLES, Make, Row, Scene, Setup, area

SLIPS = Body(slip=0.05)
EVEN = Body()
LAGS = Body(slip=0.02, lag=0.3, dead_time=0.15)
FIRST_MAP, MAPS_APART = 41_000, 500
"""Seed of the first random map, and how far apart those of two seeds of a row are."""


def drive(
    scene: Scene,
    start: Sequence[float],
    goal: Sequence[float],
    seed: int,
    model: str | kl.KoopmanModel = "nominal",
    body: Body = SLIPS,
    sense: Callable[..., Any] = sensing.known,
    problem: dict[str, Any] | None = None,
    **more: Any,
) -> Setup:
    """One drive of the paper's robot, or of one with another problem.

    Seeds beyond 0 move and turn the start a little, and draw other slips and noises.
    """
    made = kl.NavigationProblem(**{**area(scene.bounds), **(problem or {})})
    known = models.model(model, made.dt) if isinstance(model, str) else model
    begin = np.array(start, dtype=float)
    if seed:
        size = 0.05 * made.robot_radius
        begin = begin + np.random.default_rng([seed, 21]).uniform(-1, 1, 3) * (size, size, 0.05)
    plant = more.pop("plant", None) or Vehicle(body, made.dt, [seed, 3])
    return Setup(scene, begin, np.array(goal, dtype=float), made, known, plant, sense, **more)


def scene(
    *circles: Sequence[float],
    half: float = 2.0,
    bounds: Sequence[float] | None = None,
    solids: Sequence[Any] = (),
    **more: Any,
) -> Scene:
    """Obstacles in a square area, or one with bounds; circles x, y, radius, vx, vy."""
    rows = [[*row, *(0.0,) * (5 - len(row))] for row in circles]
    box = tuple(bounds) if bounds is not None else (-half, -half, half, half)
    return Scene(box, np.array(rows, dtype=float).reshape(-1, 5), tuple(solids), **more)  # type: ignore[arg-type]


def scene_of(scenario: Scenario, by: float = 1.0) -> Scene:
    """Obstacles of a scenario, with lengths and speeds times a factor."""
    rows = np.array([tuple(c) for c in scenario.circles], dtype=float).reshape(-1, 5)
    solids = (*scenario.polygons, *scenario.walls)
    if by != 1.0:
        solids = tuple(solid.scaled(1.0 / by) for solid in solids)
    grid = () if scenario.grid is None else (scenario.grid,)
    bounds = tuple(by * side for side in scenario.bounds)
    return Scene(bounds, rows * by if len(rows) else NO_CIRCLES, (*solids, *grid))  # type: ignore[arg-type]


def on_map(seed: int, family: str, number: int, by: float = 1.0, **more: Any) -> Setup:
    """A drive over a random map."""
    scenario = random_map(family, FIRST_MAP + number + MAPS_APART * seed)
    unit = np.array((by, by, 1.0))
    start, goal = unit * scenario.start, unit * scenario.goal
    more.setdefault("limit", 60.0)
    plain = drive(scene_of(scenario, by), start, goal, 0, **more)
    if "plant" not in more:
        body = more.get("body", SLIPS)
        plain.plant = Vehicle(body, plain.dt, [seed, number, 3])
    return plain


def bundled(seed: int, name: str, **more: Any) -> Setup:
    """A drive of one of the package's own scenarios."""
    scenario = Scenario.load(name)
    return drive(scene_of(scenario), scenario.start, scenario.goal, seed, **more)


def sized(by: float) -> dict[str, Any]:
    """Problem of the paper's robot with lengths and speeds times a factor."""
    turn = math.pi / 4
    return {"u_min": (-0.6 * by, -turn), "u_max": (0.6 * by, turn), "robot_radius": 0.15 * by}


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


class Table:
    """Rows of a family, added one by one."""

    def __init__(self, family: str) -> None:
        self.family, self.rows = family, list[Row]()

    def add(
        self,
        name: str,
        make: Callable[..., Setup | None],
        *arguments: Any,
        quick: bool = False,
        right: str = "arrived",
        touches: bool = False,
        chatter: float = 0.15,
        **named: Any,
    ) -> None:
        """Add a row; `make` gets the seed first, then the arguments."""
        bound: Make = partial(_seeded, make, arguments, named)
        self.rows.append(Row(name, self.family, bound, quick, right, touches, chatter))


def _seeded(
    make: Callable[..., Setup | None], arguments: tuple[Any, ...], named: dict[str, Any], seed: int
) -> Setup | None:
    # sensors remember: each drive gets its own
    fresh = {
        key: value() if isinstance(value, partial) and key == "sense" else value
        for key, value in named.items()
    }
    return make(seed, *arguments, **fresh)
