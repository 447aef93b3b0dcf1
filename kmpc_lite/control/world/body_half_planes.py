"""Half-planes of a robot that is not round: each of its circles is kept out on its own.

A half-plane in the plane becomes one in position and heading: turning moves the circles, too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.half_planes import (
    LEAST_DISTANCE,
    Clearances,
    KeepOut,
)
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.nearby import Nearby


class BodyKeepOut(KeepOut):
    """What the circles of a footprint must stay out of.

    Columns are those of the first circle, then of the next, and so on: for all obstacles of one
    kind, then for those of the next; the sides of the area are kept from the pose alone.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, margin, horizon.
    footprint : Footprint
        Its own.
    slots : int
        Half-planes per stage.
    kernels : Kernels
        Measure and choose.
    """

    directions = 3

    def __init__(
        self,
        problem: NavigationProblem,
        footprint: Footprint,
        slots: int,
        kernels: Kernels = NUMPY,
    ) -> None:
        super().__init__(problem, slots, kernels)
        self._footprint = footprint
        self._place_times = np.repeat(self._times, len(footprint.circles))

    def clearances(self, states: Array, things: Array, solids: Nearby | None) -> Clearances:
        """Clearances of stages 1 to N; normals (N, K, 3) have the slope by the heading, too."""
        places = self._footprint.places(states[1:])
        points = places.reshape(-1, 2)
        values, normals = [], []
        if len(things):
            gaps, away = self._kernels.distances_and_directions(things, points, self._place_times)
            values.append(self._by_stage(gaps))
            normals.append(self._with_slope(away, places, states))
        if solids is not None:
            gaps, away = solids.measure(points)
            values.append(self._by_stage(gaps))
            normals.append(self._with_slope(away, places, states))
        columns = sum(part.shape[1] for part in values)
        outside = self._outside(states)
        sides = np.zeros((self.horizon, outside.shape[1], 3))
        sides[:, : len(self._side_normals), :2] = self._side_normals
        if self._range is not None:
            back = states[0, :2] - states[1:, :2]
            length = np.maximum(np.hypot(back[:, 0], back[:, 1]), LEAST_DISTANCE)
            sides[:, -1, :2] = back / length[:, None]
        found = np.concatenate([*values, -outside], axis=1)
        found[:, :columns] -= self._distance
        return Clearances(found, np.concatenate([*normals, sides], axis=1), columns)

    def _by_stage(self, distances: Array) -> Array:
        """Columns (N, C M) of distances (N C, M)."""
        return distances.reshape(self.horizon, -1)

    def _with_slope(self, away: Array, places: Array, states: Array) -> Array:
        """Normals (N, C M, 3) of directions (N C, M, 2): turning moves a circle across its arm."""
        arms = places - states[1:, None, :2]
        across = np.stack([-arms[..., 1], arms[..., 0]], axis=-1).reshape(-1, 1, 2)
        slopes = (away * across).sum(axis=-1, keepdims=True)
        normals: Array = np.concatenate([away, slopes], axis=-1).reshape(self.horizon, -1, 3)
        return normals
