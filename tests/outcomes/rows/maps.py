"""Random maps of every family, bundled scenarios, walls, doors and grids."""

from __future__ import annotations

from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import sensing
from outcomes.plant import Body
from outcomes.rows.build import SLIPS, Table, bundled, drive, on_map, scattered, scene
from outcomes.setup import Scene, Setup

TABLE = Table("maps")
FLOORS = (
    ("even floor, nominal model", Body(), "nominal"),
    ("slip 0.05, learned model", SLIPS, "slip"),
    ("slip 0.2, nominal model", Body(slip=0.2), "nominal"),
    ("slip 0.2, learned model", Body(slip=0.2), "slippery"),
)
FAMILIES = ("open", "dense", "narrow", "trap", "corridor", "moving", "polygons", "walls", "rooms")
QUICK = {("open", 2), ("dense", 1), ("narrow", 0), ("corridor", 3), ("polygons", 1), ("rooms", 0)}
for place, family in enumerate(FAMILIES):
    for number, (floor, body, model) in enumerate(FLOORS):
        TABLE.add(
            f"{family} map, {floor}",
            on_map,
            family,
            10 * place + number,
            model=model,
            body=body,
            quick=(family, number) in QUICK,
        )

SCENES = Table("scenes")
for name in ("four_circles_1", "four_circles_2", "four_circles_3", "four_circles_4", "mehrez"):
    SCENES.add(f"the scenario {name}", bundled, name, quick=name == "four_circles_2")
for name in ("walls_door", "u_walls", "polygons", "room_grid"):
    SCENES.add(f"the scenario {name}", bundled, name, model="slip", quick=name == "walls_door")


def dead_end(seed: int) -> Setup:
    arms = [(0.4, y, 0.12) for y in np.arange(-0.6, 0.61, 0.2)]
    arms += [(x, s * 0.6, 0.12) for x in (-0.4, -0.2, 0.0, 0.2) for s in (1, -1)]
    return drive(scene(*arms), (-1.2, 0, 0), (1.2, 0, 0), seed, "slip")


def large_circle(seed: int) -> Setup:
    return drive(scene((0, 0, 1.2), half=5.0), (-2.2, 0.05, 0), (2.2, 0, 0), seed)


def wall(seed: int, circles: bool) -> Setup:
    solids = () if circles else (kl.Wall(0.0, -1.0, 0.0, 0.8, 0.2),)
    rows = [(0.0, y, 0.1) for y in np.arange(-1.0, 0.81, 0.05)] if circles else []
    return drive(scene(*rows, solids=solids), (-1.5, 0, 0), (1.5, 0, 0), seed, "slip")


def ragged(seed: int) -> Setup:
    random, grid = np.random.default_rng(0), np.zeros((120, 120), dtype=bool)
    for column in range(120):
        if not 80 <= column < 94:
            grid[40 + column // 3 : 44 + column // 3 + random.integers(0, 3), column] = True
    walls = kl.OccupancyGrid(grid, 0.05, (-3.0, -3.0, 0.0))
    return drive(scene(half=3.0, solids=[walls]), (-1, -2, 0), (-1, 1.5, 0), seed, "slip")


def large_grid(seed: int, cells: int) -> Setup:
    """Rooms of a big house, as one grid."""
    size, resolution = cells, 12.0 / cells
    grid = np.zeros((size, size), dtype=bool)
    for k in range(1, 4):
        grid[:, k * size // 4] = True
        grid[k * size // 4, :] = True
    door = round(0.9 / resolution)
    for row in range(4):
        for column in range(4):
            x, y = column * size // 4, row * size // 4
            grid[y + size // 10 : y + size // 10 + door, x] = column == 0
            grid[y, x + size // 8 : x + size // 8 + door] = row == 0
    grid[0] = grid[-1] = True
    grid[:, 0] = grid[:, -1] = True
    house = kl.OccupancyGrid(grid, resolution, (-6.0, -6.0, 0.0))
    at = (-5.0, -5.0, 0.0), (5.0, 4.8, 1.0)
    return drive(scene(half=6.0, solids=[house]), *at, seed, limit=90.0)


def corridor(seed: int, width: float, corner: bool = False) -> Setup:
    half = 0.5 * width + 0.05
    walls = [kl.Wall(-2.5, s * half, 2.5, s * half, 0.1) for s in (1, -1)]
    goal: tuple[float, float, float] = (2.0, 0.0, np.pi)
    if corner:
        walls = [
            kl.Wall(-2.5, -half, half, -half, 0.1),
            kl.Wall(half, -half, half, 2.5, 0.1),
            kl.Wall(-2.5, half, -half, half, 0.1),
            kl.Wall(-half, half, -half, 2.5, 0.1),
        ]
        goal = (0.0, 2.0, np.pi / 2)
    return drive(scene(half=3.0, solids=walls), (-2.0, 0, 0), goal, seed, "slip")


def door(seed: int, width: float, **more: Any) -> Setup:
    half = 0.5 * width
    walls = [kl.Wall(0, -3, 0, -half - 0.05, 0.1), kl.Wall(0, half + 0.05, 0, 3, 0.1)]
    return drive(
        scene(half=3.0, solids=walls), (-1.5, -0.8, 0), (1.5, -1.0, 0), seed, "slip", **more
    )


def spiral(seed: int) -> Setup:
    walls, length = [], 0.5
    x = y = 0.0
    for k in range(9):
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[k % 4]
        length += 0.35
        walls.append(kl.Wall(x, y, x + dx * length, y + dy * length, 0.06))
        x, y = x + dx * length, y + dy * length
    box = scene(half=4.0, solids=walls)
    return drive(box, (-3.0, 3.0, 0.0), (0.45, 0.6, 0.0), seed, limit=120.0)


def forest(seed: int, count: int) -> Setup:
    random = np.random.default_rng([seed, 31])
    start, goal = (-5.5, -5.5, 0.0), (5.5, 5.5, 1.0)
    rows = scattered(random, 5.8, count, (0.05, 0.2), 0.42, (start, goal))
    return drive(Scene((-6, -6, 6, 6), rows), start, goal, seed, "slip", limit=90.0)


def twins_of_radii(seed: int) -> Setup:
    """Radii and velocities come with noise: no other map, no search each step."""
    row = on_map(seed, "dense", 95)

    def noisy(moment: Any) -> Any:
        rows = moment.scene.circles_at(moment.time)
        rows[:, 2] += 1e-3 * moment.random.normal(size=len(rows))
        rows[:, 3:] += 1e-3 * moment.random.normal(size=(len(rows), 2))
        return rows

    row.sense = noisy
    return row


SCENES.add("a dead end is driven around", dead_end, quick=True)
SCENES.add("a circle of 1.2 m was called out of reach", large_circle, quick=True)
SCENES.add("a wall is driven around", wall, False)
SCENES.add("a wall of circles is driven around alike", wall, True)
SCENES.add("ragged walls of a lidar map", ragged)
SCENES.add("a grid of 400 x 400 seen first took 1.2 s", large_grid, 400)
SCENES.add("a house as a grid of 120 x 120", large_grid, 120)
SCENES.add("a corridor of 0.5 m and a turn at its end", corridor, 0.5)
SCENES.add("round the corner of a corridor of 0.6 m", corridor, 0.6, corner=True)
SCENES.add("a door with 6 cm to either side", door, 0.42)
SCENES.add("a door with 3 cm to either side", door, 0.36)
SCENES.add("a door that is too narrow is told", door, 0.29, limit=15.0, right="unreachable")
SCENES.add("the middle of a spiral", spiral)
SCENES.add("a forest of 200 circles", forest, 200)
SCENES.add("a forest of 100 circles", forest, 100)
SCENES.add("radii with noise are no new map each step", twins_of_radii)
SCENES.add("circles as an array", on_map, "dense", 96, sense=sensing.rows_only)
