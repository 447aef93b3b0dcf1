"""The obstacles of a step.

Circles are rows of an array; solids are prepared once, and serve for as long as they last.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.options import ObstacleOptions
from kmpc_lite.control.world.circles import Circle, circles_to_array
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Nearby, Solids

SOLID = (Polygon, Wall, OccupancyGrid)
PREPARED = (*SOLID, LaserScan)
Solid = Polygon | Wall | OccupancyGrid
Obstacle = Circle | Solid | LaserScan
Obstacles = Sequence[Obstacle] | ArrayLike
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


def _holds_prepared(obstacles: Sequence[object]) -> bool:
    """Whether there is anything but circles: of many, there are few kinds."""
    return any(issubclass(kind, PREPARED) for kind in set(map(type, obstacles)))


def too_many(obstacles: Obstacles, most: ObstacleOptions) -> str:
    """Say of which obstacles a step looks at fewer than are given; nothing if it bears them.

    Told by their numbers alone, before any of them is looked at.
    """
    total = len(obstacles) if isinstance(obstacles, Sized) else 0
    solids: list[Solid] = []
    scans = 0
    if not total:
        return ""
    if not isinstance(obstacles, np.ndarray) and isinstance(obstacles, Sequence):
        if total > most.circles + most.edges:
            return f"{total:,} obstacles: at most {most.circles:,} circles are looked at"
        if _holds_prepared(obstacles):
            solids = [o for o in obstacles if isinstance(o, SOLID)]
            scans = sum(isinstance(o, LaserScan) for o in obstacles)
    if not solids and not scans:
        beyond = total > most.circles
        return f"{total:,} circles: at most {most.circles:,} are looked at" if beyond else ""
    grids = [o for o in solids if isinstance(o, OccupancyGrid)]
    corners = [len(o.vertices) for o in solids if isinstance(o, Polygon)]
    walls = len(solids) - len(grids) - len(corners)
    for count, allowed, what in (
        (total - len(solids) - scans, most.circles, "circles"),
        (scans, MOST_SCANS, "scans"),
        (walls + len(corners) * max(corners, default=0), most.edges, "edges of polygons and walls"),
        (len(grids), MOST_GRIDS, "grids"),
        (sum(g.occupied.size for g in grids), most.grid_cells, "cells of grids"),
        (sum(g.runs for g in grids), most.grid_runs, "runs of occupied cells of grids"),
    ):
        if count > allowed:
            return f"{count:,} {what}: at most {allowed:,} are looked at"
    return ""


class Scene:
    """Sorts obstacles, and looks up those that the robot can come to.

    Parameters
    ----------
    unit : float
        Metres of one unit of the robot's lengths.
    reach : float
        How far from the robot solids count, in units.
    lookup_distance : float
        How far the robot drives before they are looked up again, in units.
    """

    def __init__(self, unit: float, reach: float, lookup_distance: float) -> None:
        self._unit, self._reach, self._lookup_distance = unit, reach, lookup_distance
        self._nearby: tuple[Solids, Array, Nearby] | None = None

    def sort(
        self, state: SceneState, obstacles: Obstacles
    ) -> tuple[Array, Solids | None, tuple[LaserScan, ...]]:
        """Circles (M, 5) and scans in metres, and solids in units if there are any.

        Raises
        ------
        ValueError
            For what is neither circles, nor solids, nor an array of circles.
        """
        if isinstance(obstacles, np.ndarray) or not isinstance(obstacles, Sequence):
            return circles_to_array(cast(ArrayLike, obstacles)), None, ()
        if not _holds_prepared(obstacles):
            return circles_to_array(cast(ArrayLike, obstacles)), None, ()
        others = tuple(o for o in obstacles if isinstance(o, PREPARED))
        scans = tuple(o for o in others if isinstance(o, LaserScan))
        solids = tuple(o for o in others if not isinstance(o, LaserScan))
        circles = circles_to_array([o for o in obstacles if not isinstance(o, PREPARED)])
        if not solids:
            return circles, None, scans
        # sequences compare their items by identity first, which is all it takes for the same ones
        if state.solids is None or state.given != solids:
            # here, since most maps have none
            from kmpc_lite.control.world.solids import Solids

            state.given = solids
            state.solids = Solids(
                [o if self._unit == 1.0 else o.scaled(self._unit) for o in solids]
            )
            state.looked_from = None
        return circles, state.solids, scans

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
