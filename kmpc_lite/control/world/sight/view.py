"""What a robot sees and remembers, from where it is in one step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.world.sight.local_map import UNKNOWN, LocalMap
from kmpc_lite.control.world.sight.outlook import Outlooks
from kmpc_lite.control.world.solids import Nearby, Solids
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight.sight import Sight

NOTHING = Solids([]).whole
"""No solids."""


class View:
    """The local map as the rooms of a step ask for it.

    Parameters
    ----------
    sight : Sight
        Answers.
    here : LocalMap
        What was seen.
    pose : ndarray
        (3,) of the robot.
    """

    def __init__(self, sight: Sight, here: LocalMap, pose: Array) -> None:
        self._sight, self._map, self._pose = sight, here, pose
        self._outlooks = Outlooks(here.outlooks[:, :4])
        self.is_narrow = self._outlooks.is_narrow
        """Whether there are directions in which no scanner looks."""
        self._seen = sight.seen(here, pose)
        self.hits: Nearby | None = None
        """What was hit near the robot; none if nothing was."""
        if self._seen.hits:
            self.hits = NOTHING.with_boxes(self._seen.hits)
        self.unknown = NOTHING.with_boxes(self._seen.unknown) if self._seen.unknown else None
        """What was not seen to be free near the robot; none if all was."""
        self.coarseness = math.sqrt(2.0) * here.cell
        """How far cells may stand out of what was hit in them."""

    def around(self, solids: Nearby | None) -> Nearby | None:
        """Solids that the robot can come to, what was hit, and what was not seen to be free."""
        more = [*self._seen.hits, *self._seen.unknown]
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

        Parameters
        ----------
        points : ndarray
            Near the robot.
        place : ndarray
            (2,) where it is.
        distance : float
            What it needs around it: there may be darkness farther away.
        """
        if self.unknown is None:
            return np.zeros(len(points), dtype=bool)
        # what stands out by less than a quarter of a cell is rounding
        least = min(distance, float(self.unknown.least(place[None])[0])) - 0.25 * self._map.cell
        found: Array = self.unknown.least(points) < least
        return found

    def turns_to_see(self, points: Array, distance: float, slack: float) -> Array:
        """Turns [rad] to what is unknown near points (n, 2), and is not looked at, (m,)."""
        if not self._seen.unknown:
            return np.empty(0)
        boxes, inside = self._seen.unknown[0], 0.5 * self._map.cell
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

    def blocks(self, points: Array, distance: float) -> bool:
        """Whether something that was hit is nearer than a distance to any of points (n, 2)."""
        return bool(len(points)) and self._sight.blocks(self._map, points, distance)

    def solids(self, given: Solids | None) -> Solids | None:
        """What was hit, together with solids that are given, for a path search."""
        return self._sight.solids(self._map, given)
