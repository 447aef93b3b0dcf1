"""What an emulated robot's sensors see of a scenario: a map of cells, and ranges of beams."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.gaps import point_gaps
from kmpc_lite.types import Array

BORDER = 0.5
"""The map reaches so far beyond the scenario's area [m]."""
CLOSE = 0.002
"""A beam ends where an obstacle is nearer than this [m]."""
STEPS = 80
"""Steps by which a beam is followed; one that grazes an obstacle takes many."""
OCCUPIED, FREE = 100, 0


class CellMap(NamedTuple):
    """A map as nav_msgs/OccupancyGrid has it."""

    cells: NDArray[np.int8]
    """(height, width), the lowest row first."""
    resolution: float
    """[m]"""
    origin: tuple[float, float]
    """Of the first cell's corner [m]."""


class World:
    """A scenario's obstacles.

    `scenario`: its circles and solids stand where they are at the beginning.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def distances(self, points: Array) -> Array:
        """Distances (n,) of points (n, 2) from the nearest edge [m]; negative inside."""
        return point_gaps(self._scenario, points, np.zeros(len(points)))

    def cells(self, resolution: float = 0.05) -> CellMap:
        """Cells that an obstacle touches, of a side [m]."""
        x_min, y_min, x_max, y_max = self._scenario.bounds
        low = np.array((x_min, y_min)) - BORDER
        width, height = np.ceil((np.array((x_max, y_max)) + BORDER - low) / resolution).astype(int)
        x = low[0] + resolution * (np.arange(width) + 0.5)
        y = low[1] + resolution * (np.arange(height) + 0.5)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        near = self.distances(points) < resolution * np.sqrt(0.5)
        cells = np.where(near, OCCUPIED, FREE).astype(np.int8).reshape(height, width)
        return CellMap(cells, resolution, (float(low[0]), float(low[1])))

    def ranges(self, eye: Array, angles: Array, farthest: float) -> Array:
        """How far beams at angles (B,) [rad] from an eye (2,) [m] reach; infinite past `farthest`.

        A beam goes on by the distance to the nearest edge, over which it cannot jump.
        """
        along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        reach = np.zeros(len(angles))
        for _ in range(STEPS):
            gap = np.minimum(self.distances(eye + reach[:, None] * along), farthest)
            moving = (gap > CLOSE) & (reach < farthest)
            if not moving.any():
                break
            reach = np.where(moving, reach + gap, reach)
        return np.where(reach < farthest, reach, np.inf)
