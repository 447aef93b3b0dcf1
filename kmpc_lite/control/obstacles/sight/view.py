"""What a robot sees and remembers, from where it is in one step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.obstacles.nearby import Nearby
from kmpc_lite.control.obstacles.sight.local_map import LocalMap
from kmpc_lite.control.obstacles.solids import Solids
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.sight.sight import Sight

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
    speed : float
        Of the command sent last.
    """

    def __init__(self, sight: Sight, here: LocalMap, pose: Array, speed: float) -> None:
        self._sight, self._map = sight, here
        self._seen = sight.seen(here, pose, speed)
        self.hits: Nearby | None = None
        """What was hit near the robot; none where nothing was."""
        if self._seen.hits:
            self.hits = NOTHING.with_boxes(self._seen.hits)
        self._unknown = NOTHING.with_boxes(self._seen.unknown) if self._seen.unknown else None
        self.coarseness = math.sqrt(2.0) * here.cell
        """How far cells may stand out of what was hit in them."""
        self.blocked_interval = sight.options.blocked_interval
        self.refresh_interval = sight.options.refresh_interval
        self.gear_time = sight.options.gear_time
        self.lattice_nodes = sight.options.lattice_nodes
        self.lattice_step = sight.options.lattice_step

    def around(self, solids: Nearby | None) -> Nearby | None:
        """Solids that the robot can come to, what was hit, and what was not seen to be free."""
        more = [*self._seen.hits, *self._seen.unknown]
        if not more:
            return solids
        return (NOTHING if solids is None else solids).with_boxes(more)

    def is_dark(self, points: Array, distance: float) -> Array:
        """Which of points (n, 2) near the robot lie within a distance of what is unknown, (n,)."""
        if self._unknown is None:
            return np.zeros(len(points), dtype=bool)
        found: Array = self._unknown.least(points) < distance
        return found

    def blocks(self, points: Array, distance: float) -> bool:
        """Whether something that was hit is nearer than a distance to any of points (n, 2)."""
        return bool(len(points)) and self._sight.blocks(self._map, points, distance)

    def solids(self, given: Solids | None) -> Solids | None:
        """What was hit, together with solids that are given, for a path search."""
        return self._sight.solids(self._map, given)
