"""What a family of random maps draws, and what all of them have in common."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

BOUNDS = (-2.0, -2.0, 2.0, 2.0)
ROBOT_RADIUS = 0.15
Random = np.random.Generator


class Layout(NamedTuple):
    """One draw; it may well lack a passage."""

    circles: Array
    """(M, 5) rows x, y, radius, vx, vy."""
    start: Array
    """(3,)"""
    goal: Array
    """(3,)"""
    polygons: tuple[Polygon, ...] = ()
    walls: tuple[Wall, ...] = ()
    grid: OccupancyGrid | None = None

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Polygons, walls and the grid."""
        return (*self.polygons, *self.walls, *(() if self.grid is None else (self.grid,)))


def draw_ends(random: Random) -> tuple[Array, Array]:
    """Start and goal anywhere in the area, at least 2 m apart, with any headings."""
    while True:
        start, goal = random.uniform(-1.8, 1.8, (2, 3))
        start[2], goal[2] = random.uniform(-np.pi, np.pi, 2)
        if np.hypot(*(goal - start)[:2]) >= 2.0:
            return start, goal


def at_rest(positions: Array, radii: Array) -> Array:
    """Circles (M, 5) that do not move."""
    return np.column_stack([positions, radii, np.zeros((len(radii), 2))])
