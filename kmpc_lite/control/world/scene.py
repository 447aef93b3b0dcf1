"""The obstacles of a step.

Circles are rows of an array; solids are prepared once, and serve for as long as they last.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.options import USUAL_OBSTACLES, ObstacleOptions
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall, circles_to_array
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Nearby, Solids

SOLID = (Polygon, Wall, OccupancyGrid)
PREPARED = (*SOLID, LaserScan)
Solid = Polygon | Wall | OccupancyGrid
Obstacle = Circle | Solid | LaserScan
Obstacles = Sequence[Obstacle] | ArrayLike
NO_CIRCLES = circles_to_array(())
MOST_SCANS = MOST_GRIDS = 10
"""Laser scans, and grids, of one step."""


@dataclass(slots=True)
class SceneState:
    """The solids that were prepared last."""

    given: tuple[Solid, ...] = ()
    """As the caller gave them, in metres."""
    solids: Solids | None = None
    """The same, prepared, in the robot's units."""
    looked_from: Array | None = None
    """(2,) where those that are near were looked up last."""


def too_many(circles: int, solids: Sequence[Solid], scans: int, most: ObstacleOptions) -> str:
    """Say of which obstacles a step looks at fewer than are given; nothing if it bears them.

    Told by their numbers alone, before any of them is looked at.
    """
    corners = polygons = walls = grids = cells = runs = 0
    for solid in solids:
        if isinstance(solid, OccupancyGrid):
            grids, cells, runs = grids + 1, cells + solid.occupied.size, runs + solid.runs
        elif isinstance(solid, Polygon):
            polygons, corners = polygons + 1, max(corners, len(solid.vertices))
        else:
            walls += 1
    for count, allowed, what in (
        (circles, most.circles, "circles"),
        (scans, MOST_SCANS, "scans"),
        (walls + polygons * corners, most.edges, "edges of polygons and walls"),
        (grids, MOST_GRIDS, "grids"),
        (cells, most.grid_cells, "cells of grids"),
        (runs, most.grid_runs, "runs of occupied cells of grids"),
    ):
        if count > allowed:
            return f"{count:,} {what}: at most {allowed:,} are looked at"
    return ""


class Scene:
    """Sorts obstacles, and looks up those that the robot can come to.

    `unit`: metres of one unit of the robot's lengths. `reach`: how far from the robot solids count,
    in units. `lookup_distance`: how far the robot drives before they are looked up again, in units.
    `most`: how many are looked at.
    """

    def __init__(
        self,
        unit: float,
        reach: float,
        lookup_distance: float,
        most: ObstacleOptions = USUAL_OBSTACLES,
    ) -> None:
        self._unit, self._reach, self._lookup_distance = unit, reach, lookup_distance
        self._most = most
        self._nearby: tuple[Solids, Array, Nearby] | None = None

    def sort(
        self, state: SceneState, obstacles: Obstacles
    ) -> tuple[str, Array, Solids | None, tuple[LaserScan, ...]]:
        """Why they are too many; circles (M, 5) and scans in metres, and solids in units if any.

        Raises ValueError for what is neither circles, nor solids, nor an array of circles.
        """
        # an array of no dimension has no length, though it is sized
        sized = isinstance(obstacles, Sized) and getattr(obstacles, "ndim", 1) > 0
        most, total = self._most, len(cast(Sized, obstacles)) if sized else 0
        circles, solids, scans = obstacles, list[Solid](), list[LaserScan]()
        if isinstance(obstacles, Sequence) and not isinstance(obstacles, np.ndarray):
            if total > most.circles + most.edges:
                refusal = f"{total:,} obstacles: at most {most.circles:,} circles are looked at"
                return refusal, NO_CIRCLES, None, ()
            # of many, there are few kinds
            if any(issubclass(kind, PREPARED) for kind in set(map(type, obstacles))):
                circles = _sorted(cast(Sequence[Obstacle], obstacles), solids, scans)
        refusal = too_many(total - len(solids) - len(scans), solids, len(scans), most)
        if refusal:
            return refusal, NO_CIRCLES, None, ()
        rows = circles_to_array(cast(ArrayLike, circles))
        if not solids:
            return "", rows, None, tuple(scans)
        # sequences compare their items by identity first, which is all it takes for the same ones
        given = tuple(solids)
        if state.solids is None or state.given != given:
            # here, since most maps have none
            from kmpc_lite.control.world.solids import Solids

            state.given = given
            state.solids = Solids(
                [o if self._unit == 1.0 else o.scaled(self._unit) for o in solids]
            )
            state.looked_from = None
        return "", rows, state.solids, tuple(scans)

    def near(self, state: SceneState, solids: Solids | None, point: Array) -> Nearby | None:
        """Solids within reach of a point (2,), and perhaps some farther ones.

        They are looked up anew only when the robot has moved on.
        """
        if solids is None:
            return None
        before = state.looked_from
        if before is None or not np.abs(point - before).max() <= self._lookup_distance:
            state.looked_from = before = point.copy()
        known = self._nearby
        if known is None or known[0] is not solids or not np.array_equal(known[1], before):
            # beyond the reach by as much as the robot may drive until the next look
            within = self._reach + 2.0 * self._lookup_distance
            self._nearby = known = solids, before, solids.within(before, within)
        return known[2]


def _sorted(
    obstacles: Sequence[Obstacle], solids: list[Solid], scans: list[LaserScan]
) -> list[Circle]:
    """Put solids and scans apart, and give the others."""
    circles = []
    for one in obstacles:
        if isinstance(one, LaserScan):
            scans.append(one)
        elif isinstance(one, SOLID):
            solids.append(one)
        else:
            circles.append(one)
    return circles
