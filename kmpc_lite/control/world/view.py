"""What a robot sees and remembers, from where it is in one step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels import library, scan_library
from kmpc_lite.control.options import USUAL_OBSTACLES
from kmpc_lite.control.world.local_map import IN_VAIN, UNKNOWN, LocalMap, cell_distances
from kmpc_lite.control.world.occupancy import Boxes, OccupancyGrid, count_runs
from kmpc_lite.control.world.rays import Outlooks
from kmpc_lite.control.world.solids import Nearby, Solids
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight import Sight

NOTHING = Solids([]).whole
"""No solids."""
WORLD = OccupancyGrid([[0]], 1.0)
"""A grid in the world's own frame, for rectangles that belong to none."""


class View:
    """The local map as the rooms of a step ask for it.

    `sight`: how far it looks. `here`: what was seen. `pose`: (3,) of the robot.
    """

    def __init__(self, sight: Sight, here: LocalMap, pose: Array) -> None:
        self._sight, self._map, self._pose = sight, here, pose
        self._outlooks = Outlooks(here.outlooks[:, :4])
        self.is_narrow = self._outlooks.is_narrow
        """Whether there are directions in which no scanner looks."""
        self._hits, self._unknown = self._look()
        self.hits = NOTHING.with_boxes(self._hits) if self._hits else None
        """What was hit near the robot; none if nothing was."""
        self.unknown = NOTHING.with_boxes(self._unknown) if self._unknown else None
        """What was not seen to be free near the robot; none if all was."""
        self.coarseness = math.sqrt(2.0) * here.cell
        """How far cells may stand out of what was hit in them."""

    def around(self, solids: Nearby | None) -> Nearby | None:
        """Solids that the robot can come to, what was hit, and what was not seen to be free."""
        more = [*self._hits, *self._unknown]
        if not more:
            return solids
        return (NOTHING if solids is None else solids).with_boxes(more)

    def is_dark(self, points: Array, distance: float) -> Array:
        """Which of points (n, 2) near the robot lie within a distance of what is unknown, (n,)."""
        if self.unknown is None:
            return np.zeros(len(points), dtype=bool)
        found: Array = self.unknown.least(points) < distance
        return found

    def leads_into_dark(self, points: Array, place: Array, distance: float) -> Array:
        """At which of points (n, 2) a robot comes nearer to what is unknown than it is, (n,).

        `points`: near the robot. `place`: (2,) where it is. `distance`: what it needs around it:
        there may be darkness farther away.
        """
        if self.unknown is None:
            return np.zeros(len(points), dtype=bool)
        # what stands out by less than a quarter of a cell is rounding
        least = min(distance, float(self.unknown.least(place[None])[0])) - 0.25 * self._map.cell
        found: Array = self.unknown.least(points) < least
        return found

    def turns_to_see(self, points: Array, distance: float, slack: float) -> Array:
        """Turns [rad] to what is unknown near points (n, 2), and is not looked at, (m,)."""
        if not self._unknown:
            return np.empty(0)
        boxes, inside = self._unknown[0], 0.5 * self._map.cell
        nearest = np.clip(points[:, None], boxes.low, boxes.high)
        near = np.hypot(*(points[:, None] - nearest).transpose(2, 0, 1)) < distance
        # a cell has been seen when its middle was
        middles = np.clip(points[:, None], boxes.low + inside, boxes.high - inside)
        return self._outlooks.turns(self._pose, middles[near], slack)

    def blind_turn(self, direction: float) -> float:
        """How far a robot must turn until it sees what lies in a direction in its frame [rad]."""
        return float(self._outlooks.beyond(np.array([direction]))[0]) if self.is_narrow else 0.0

    def unknown_cells(self) -> tuple[Array, Array, float]:
        """Cells (H, W) of which nothing is known, where the first begins (2,), and their side."""
        return self._map.state <= UNKNOWN, self._map.corner, self._map.cell

    def _look(self) -> tuple[list[Boxes], list[Boxes]]:
        """What was hit near the robot, and what was never seen to be free."""
        here, sight = self._map, self._sight
        window = here.window(self._pose[:2], sight.reach)
        top, bottom, left, right = window
        area = slice(top, bottom), slice(left, right)
        state = here.state[area]
        hits = scan_library.hit_boxes(here.state, here.extent, window, here.place)
        unknown = state <= UNKNOWN
        if sight.emerging > 0.0:
            # something may come out of what is not seen now
            unknown = unknown | ((state == 0) & (here.seen[area] < here.clock - sight.period))
            away = cell_distances(here, window, sight.footprint, self._pose)
            unknown &= away > sight.radius + here.cell
        left, bottom = left + here.column, top + here.row
        sides = here.cell * (scan_library.rectangles(unknown) + (left, bottom, left, bottom))
        # a wall is told by few half-planes, noise and all
        both = hits, (sides[:, :2], sides[:, 2:])
        found, dark = (
            [Boxes(low, high, WORLD, here.cell)] if len(low) else [] for low, high in both
        )
        return found, dark

    def solids(self, given: Solids | None) -> Solids | None:
        """All that is known to be occupied, with solids that are given, for a path search."""
        here = self._map
        is_hit = (here.state > 0) | (here.state <= IN_VAIN)
        rows, columns = np.flatnonzero(is_hit.any(axis=1)), np.flatnonzero(is_hit.any(axis=0))
        if not len(rows):
            return given
        (top, bottom), (left, right) = rows[[-1, 0]] + (1, 0), columns[[0, -1]] + (0, 1)
        occupied, cell = is_hit[bottom:top, left:right], here.cell
        corner = cell * np.array([here.column + left, here.row + bottom])
        # of dense noise: in larger cells, which hold all that the smaller ones did
        while count_runs(occupied) > USUAL_OBSTACLES.grid_runs:
            height, width = occupied.shape
            even = np.pad(occupied, ((0, height % 2), (0, width % 2)))
            occupied = (even[::2] | even[1::2])[:, ::2] | (even[::2] | even[1::2])[:, 1::2]
            cell *= 2.0
        others = () if given is None else given.solids
        return Solids([*others, OccupancyGrid(occupied, cell, corner)])

    def blocks(self, points: Array, distance: float) -> bool:
        """Whether something that was hit is nearer than a distance to any of points (n, 2)."""
        here = self._map
        points = points[here.is_near(points, distance)]
        if not len(points):
            return False
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half = 0.5 * (low + high), float((high - low).max()) / 2.0
        window = here.window(middle, half + distance + here.cell)
        boxes = scan_library.hit_boxes(here.state, here.extent, window, here.place)
        near = ((boxes[1] > low - distance) & (boxes[0] < high + distance)).all(axis=1)
        if not near.any():
            return False
        away = library.box_distances(boxes[0][near], boxes[1][near], points)
        return bool(away.min() < distance)
