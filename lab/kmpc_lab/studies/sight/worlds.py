"""Worlds unknown to the robot: rooms, mazes, forests, of a robot's size."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kmpc_lab.sim.lidar import box_edges
from kmpc_lab.sim.maps.families import has_passage
from kmpc_lite.control.world.circles import Circle
from kmpc_lite.control.world.shapes import Polygon
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

SIDE = 7.0
"""Of the area of a robot of `UNIT_RADIUS` [m]."""
PASSAGE = 0.08
"""Distance beyond its radius that a way to the goal keeps [m]."""
THICK = 0.1
"""Of a wall [m]."""
ATTEMPTS = 200
Random = np.random.Generator


@dataclass(frozen=True)
class Course:
    """A world, and where from and where to."""

    name: str
    world: World
    start: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    side: float
    """Of the area [m]."""


@dataclass(frozen=True)
class Drawn:
    """What a kind of world consists of, for a robot of `UNIT_RADIUS`."""

    circles: Array
    """(M, 3) rows x, y, radius [m]."""
    boxes: Array
    """(B, 4) rows x1, y1, x2, y2 [m]."""
    start: Array
    goal: Array


def course_of(kind: str, seed: int, radius: float) -> Course:
    """Draw a world for a robot of a radius [m], with a way to the goal."""
    random = np.random.default_rng([seed, sum(kind.encode())])
    half, by = 0.5 * SIDE, radius / UNIT_RADIUS
    for _ in range(ATTEMPTS):
        drawn = KINDS[kind](random)
        x1, y1, x2, y2 = drawn.boxes.T
        solids = [
            Polygon([(a, b), (c, b), (c, d), (a, d)])
            for a, b, c, d in zip(x1, y1, x2, y2, strict=True)
        ]
        bounds = np.array([-half, -half, half, half]) + UNIT_RADIUS * np.array([1, 1, -1, -1])
        circles = np.array([Circle(*row) for row in drawn.circles]).reshape(-1, 5)
        clearance = UNIT_RADIUS + PASSAGE
        if has_passage(
            circles, drawn.start, drawn.goal, clearance, bounds, cell=0.04, solids=solids
        ):
            break
    edges = [box_edges(*box) for box in drawn.boxes] + [box_edges(-half, -half, half, half)]
    scale = np.array([by, by, by, 1.0, 1.0])
    unit = np.array([by, by, 1.0])
    world = World(circles * scale, by * np.concatenate(edges))
    return Course(f"{kind} {seed}", world, unit * drawn.start, unit * drawn.goal, by * SIDE)


def _ends(random: Random) -> tuple[Array, Array]:
    """Start and goal in opposite corners."""
    half = 0.5 * SIDE
    corner = np.array(random.choice([-1.0, 1.0], 2))
    places = [sign * corner * (half - random.uniform(0.4, 0.8, 2)) for sign in (1.0, -1.0)]
    start, goal = (np.append(p, random.uniform(-math.pi, math.pi)) for p in places)
    return start, goal


def _forest(random: Random) -> Drawn:
    """Thirty to forty-five trunks."""
    count, half = int(random.integers(30, 46)), 0.5 * SIDE
    places = random.uniform(-half + 0.2, half - 0.2, (count, 2))
    sizes = random.uniform(0.04, 0.25, count)
    return Drawn(np.column_stack([places, sizes]), np.empty((0, 4)), *_ends(random))


def _maze(random: Random) -> Drawn:
    """A maze of 6 x 6 cells, with some of its walls taken away."""
    cells = 6
    step, half = SIDE / cells, 0.5 * SIDE
    walls = {(x, y, d) for x in range(cells) for y in range(cells) for d in (0, 1)}
    walls -= {(cells - 1, y, 0) for y in range(cells)} | {(x, cells - 1, 1) for x in range(cells)}
    known, trail = {(0, 0)}, [(0, 0)]
    while trail:
        x, y = trail[-1]
        ways = [
            ((x + dx, y + dy), (x + min(dx, 0), y + min(dy, 0), int(dx == 0)))
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
            if 0 <= x + dx < cells and 0 <= y + dy < cells and (x + dx, y + dy) not in known
        ]
        if not ways:
            trail.pop()
            continue
        place, wall = ways[int(random.integers(len(ways)))]
        walls.discard(wall)
        known.add(place)
        trail.append(place)
    kept = [wall for wall in sorted(walls) if random.random() < 0.8]
    boxes = []
    for x, y, d in kept:
        low = np.array([x + (d == 0), y + (d == 1)]) * step - half
        high = low + step * np.array([d == 1, d == 0])
        boxes.append((*(low - 0.5 * THICK), *(high + 0.5 * THICK)))
    places = np.array([(0.5, 0.5), (cells - 0.5, cells - 0.5)]) * step - half
    if random.random() < 0.5:
        places = places[::-1]
    start, goal = (np.append(p, random.uniform(-math.pi, math.pi)) for p in places)
    return Drawn(np.empty((0, 3)), np.array(boxes).reshape(-1, 4), start, goal)


def _rooms(random: Random) -> Drawn:
    """Four to six rooms with doors, and furniture."""
    half = 0.5 * SIDE
    x, y = random.uniform(-1.0, 1.0, 2)
    boxes = _wall(random, x, (-half, y), True) + _wall(random, x, (y, half), True)
    boxes += _wall(random, y, (-half, x), False) + _wall(random, y, (x, half), False)
    for _ in range(int(random.integers(5, 10))):
        corner, size = random.uniform(-half, half - 0.5, 2), random.uniform(0.2, 0.6, 2)
        boxes.append((*corner, *(corner + size)))
    circles = np.column_stack([random.uniform(-half, half, (6, 2)), np.full(6, 0.04)])
    return Drawn(circles, np.array(boxes), *_ends(random))


def _wall(
    random: Random, place: float, along: tuple[float, float], upright: bool
) -> list[tuple[float, float, float, float]]:
    """Two boxes of a wall, with a door of 0.6 to 0.9 m between them."""
    low, high = along
    width = random.uniform(0.6, 0.9)
    begin = random.uniform(low + 0.2, high - 0.2 - width)
    thick = 0.5 * THICK
    parts = [(low, begin), (begin + width, high)]
    if upright:
        return [(place - thick, a, place + thick, b) for a, b in parts]
    return [(a, place - thick, b, place + thick) for a, b in parts]


KINDS: dict[str, Callable[[Random], Drawn]] = {"rooms": _rooms, "maze": _maze, "forest": _forest}
"""``rooms``: a house with doors of 0.6 to 0.9 m and furniture; ``maze``: 6 x 6 cells of 1.17 m;
``forest``: 30 to 45 trunks; all for a robot of `UNIT_RADIUS`."""
