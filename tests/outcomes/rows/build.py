"""Any drive, anywhere: makers of ``rows.toml``, which get the seed first.

Seeds beyond 0 move and turn the start a little, and draw other slips and noises.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models, sensing
from outcomes.lab import Scenario, box_edges, random_map
from outcomes.plant import Array, Body, Vehicle
from outcomes.rows.poses import MEASURES
from outcomes.setup import NO_CIRCLES, Scene, Setup, area
from outcomes.steered import Bicycle, Mecanum, Rollers, Steering

SLIPS = Body(slip=0.05)
FIRST_MAP, MAPS_APART = 41_000, 500
"""Seed of the first random map, and how far apart those of two seeds of a row are."""


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
    plant_seed: Sequence[int] | None = None,
    **more: Any,
) -> Setup:
    """One drive of the paper's robot, or of one with another body and problem.

    `sense`, `measure`: or their names. `model`: or its name.
    """
    made = kl.NavigationProblem(**{**area(scene.bounds), **(problem or {})})
    plant = more.pop("plant", None) or plant_of(body, made.dt, plant_seed or [seed, 3])
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
    slips = isinstance(more.get("body", SLIPS), Body)
    seeds = [seed, number, 3] if slips else [seed, 3]
    return drive(scene_of(scenario, by), start, goal, 0, plant_seed=seeds, **more)


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
