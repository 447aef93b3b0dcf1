"""Random maps of polygons, of walls, and of rooms drawn as a grid."""

from __future__ import annotations

import numpy as np

from kmpc_lab.sim.maps.layout import BOUNDS, Layout, Random, at_rest, draw_ends
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

CELL = 0.05
"""Side of the cells of the rooms' grid [m]."""
ROOM = 3.9
"""Sides of the house, outer walls included [m]."""
WALL, DOOR = 0.10, (0.56, 0.75)
"""Thickness of the walls inside, and least and largest width of a door [m]."""


def draw_polygons(random: Random) -> Layout:
    """Four to seven convex polygons of 3 to 7 corners, and up to two circles."""
    polygons = []
    for _ in range(int(random.integers(4, 8))):
        # corners on an ellipse are convex; apart, so that none is cut off to nothing
        angles = np.cumsum(random.uniform(0.5, 1.0, int(random.integers(3, 8))))
        angles *= 2 * np.pi / (angles[-1] + random.uniform(0.3, 0.8))
        axes, turn = random.uniform(0.12, 0.45, 2), random.uniform(-np.pi, np.pi)
        local = np.column_stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)])
        polygons.append(Polygon(random.uniform(-1.4, 1.4, 2) + local @ _turned(turn)))
    count = int(random.integers(0, 3))
    circles = at_rest(random.uniform(-1.5, 1.5, (count, 2)), random.uniform(0.10, 0.2, count))
    return Layout(circles, *draw_ends(random), polygons=tuple(polygons))


def draw_walls(random: Random) -> Layout:
    """Four to seven straight walls; every other one begins at an angle in the middle of another.

    They are up to 10 cm thick.
    """
    walls: list[Wall] = []
    for i in range(int(random.integers(4, 8))):
        middle = random.uniform(-1.4, 1.4, 2)
        if i % 2:
            other = walls[-1]
            middle = np.array([0.5 * (other.x1 + other.x2), 0.5 * (other.y1 + other.y2)])
        heading, length = random.uniform(-np.pi, np.pi), random.uniform(0.5, 1.6)
        end = middle + length * np.array([np.cos(heading), np.sin(heading)])
        walls.append(Wall(middle[0], middle[1], end[0], end[1], random.uniform(0.0, 0.1)))
    return Layout(np.empty((0, 5)), *draw_ends(random), walls=tuple(walls))


def draw_rooms(random: Random) -> Layout:
    """A house of three or four rooms with furniture, turned by any angle, as a grid.

    The grid lies along the axes of the map or of the house.
    """
    turn = random.uniform(-np.pi, np.pi)
    split, cross = random.uniform(-0.5, 0.5, 2)
    half = 0.5 * ROOM
    inner = half - WALL
    boxes = [
        (-half, -half, half, -inner),
        (-half, inner, half, half),
        (-half, -half, -inner, half),
        (inner, -half, half, half),
    ]
    boxes += _wall_with_door(random, split, -half, half, along_y=True)
    for low, high in ((-half, split), (split, half))[: int(random.integers(1, 3))]:
        boxes += _wall_with_door(random, cross, low, high, along_y=False)
    for _ in range(int(random.integers(2, 5))):
        corner, size = random.uniform(-half, half - 0.3, 2), random.uniform(0.15, 0.45, 2)
        boxes.append((*corner, *(corner + size)))
    rotation = _turned(turn)
    along_house = bool(random.integers(0, 2))
    reach = half if along_house else half * (abs(np.cos(turn)) + abs(np.sin(turn)))
    cells = int(np.ceil(2 * reach / CELL))
    centres = CELL * (np.arange(cells) + 0.5) - 0.5 * cells * CELL
    x, y = np.meshgrid(centres, centres)
    places = np.stack([x, y], axis=-1)
    if not along_house:
        places = places @ rotation.T
    occupied = np.zeros((cells, cells), dtype=bool)
    for x_min, y_min, x_max, y_max in boxes:
        occupied |= (
            (places[..., 0] >= x_min)
            & (places[..., 0] <= x_max)
            & (places[..., 1] >= y_min)
            & (places[..., 1] <= y_max)
        )
    corner = -0.5 * cells * CELL * np.ones(2)
    origin = (*(corner @ rotation), turn) if along_house else (*corner, 0.0)
    grid = OccupancyGrid(occupied, CELL, origin)
    inside = inner - 0.2
    x = random.uniform(-inside, split - 0.3), random.uniform(split + 0.3, inside)
    ends = np.column_stack([x, random.uniform(-inside, inside, 2)]) @ rotation
    # the corners of a house that stands askew reach beyond the area
    ends = np.clip(ends, BOUNDS[:2], BOUNDS[2:])
    headings = random.uniform(-np.pi, np.pi, 2)
    return Layout(
        np.empty((0, 5)),
        np.append(ends[0], headings[0]),
        np.append(ends[1], headings[1]),
        grid=grid,
    )


def _wall_with_door(
    random: Random, place: float, low: float, high: float, along_y: bool
) -> list[tuple[float, float, float, float]]:
    """Two boxes of a wall at `place` from `low` to `high`, with a door between them."""
    width = random.uniform(*DOOR)
    begin = random.uniform(low + 0.15, high - 0.15 - width)
    parts = [
        (place - 0.5 * WALL, low, place + 0.5 * WALL, begin),
        (place - 0.5 * WALL, begin + width, place + 0.5 * WALL, high),
    ]
    return parts if along_y else [(y0, x0, y1, x1) for x0, y0, x1, y1 in parts]


def _turned(angle: float) -> Array:
    """Matrix (2, 2) that turns rows by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])
