"""Polygons, walls and grids on a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lab.report.style import INK
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import corners_of
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Wall
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lab.report.map_labels import Labels

SOLID_LOOK: dict[str, Any] = {"facecolor": "#a9a9a9", "edgecolor": INK, "linewidth": 0.9}
MOST_POINTS = 2000
"""Of a grid, for labels to stay away from."""


def draw_solids(axes: Any, solids: tuple[Solid, ...], labels: Labels) -> None:
    """Draw solids to scale."""
    from matplotlib.collections import PolyCollection

    for solid in solids:
        if isinstance(solid, OccupancyGrid):
            # no lines between the rectangles, which are none of the map's
            look = {
                "facecolor": SOLID_LOOK["facecolor"],
                "edgecolor": SOLID_LOOK["facecolor"],
                "linewidth": 0.3,
            }
            axes.add_collection(PolyCollection(list(_corners(solid)), zorder=2, **look))
            cells = np.argwhere(solid.occupied)[:, ::-1]
            places = solid.to_map(
                solid.resolution * (cells[:: max(1, len(cells) // MOST_POINTS)] + 0.5)
            )
            labels.avoid_lines(places)
            continue
        outline = _capsule(solid) if isinstance(solid, Wall) else corners_of(solid)
        axes.add_collection(PolyCollection([outline], zorder=2, **SOLID_LOOK))
        along = np.linspace(0.0, 1.0, 20)[:, None]
        corners = corners_of(solid)
        labels.avoid_lines(
            np.concatenate(
                [
                    (1.0 - along) * a + along * b
                    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
                ]
            )
        )


def solid_points(solids: tuple[Solid, ...]) -> Array:
    """Corners (V, 2) of all solids: what a map shows of them [m]."""
    found = [
        _corners(s).reshape(-1, 2) if isinstance(s, OccupancyGrid) else corners_of(s)
        for s in solids
    ]
    return np.concatenate([np.empty((0, 2)), *found])


def _corners(grid: OccupancyGrid) -> Array:
    """Corners of the rectangles (B, 4, 2)."""
    return grid.to_map(grid.rectangles[:, [[0, 1], [2, 1], [2, 3], [0, 3]]])


def _capsule(wall: Wall) -> Array:
    """Outline (K, 2) of a wall with round ends."""
    ends = corners_of(wall)
    along = float(np.arctan2(ends[1, 1] - ends[0, 1], ends[1, 0] - ends[0, 0]))
    turn = np.linspace(-np.pi / 2, np.pi / 2, 12)
    halves = []
    for end, forward in zip(ends, (along + np.pi, along), strict=True):
        halves.append(
            end
            + 0.5
            * wall.thickness
            * np.column_stack([np.cos(forward + turn), np.sin(forward + turn)])
        )
    return np.concatenate(halves)
