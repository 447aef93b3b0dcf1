"""How obstacles enter the QP: each as the half-plane that its nearest point stands for.

A circle, a polygon, a wall or a cell of a grid lies behind the half-plane through its nearest
point, across the direction from there to the robot. The QP keeps each stage out of the nearest few.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Nearby

LEAST_DISTANCE = 1e-9
"""Distance from the robot below which there is no direction towards it [m]."""


class Clearances(NamedTuple):
    """Clearances of stages 1 to N from K obstacles and sides, obstacles first."""

    values: Array
    """(N, K) [m], negative inside."""
    normals: Array
    """(N, K, 2) unit vectors away from them."""
    obstacle_count: int
    """How many of the K are obstacles; the others are sides of the area."""


class KeepOut:
    """What the circles of a robot's outline stay out of: obstacles, and the outside of the area.

    Obstacles are circles and solids, grown by the circles' radius and the problem's margin. Columns
    are those of the first circle, then of the next, and so on: for all things, then for all solids;
    the sides of the area are kept from the pose alone.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, outline, margin, horizon.
    slots : int
        Half-planes per stage: the nearest of all obstacles and sides.
    kernels : Kernels
        Measure and choose.

    Attributes
    ----------
    directions : int
        By how many of a state's coordinates a clearance has slopes: x, y, and the heading of a
        robot that is not round.
    side_normals, side_offsets : ndarray
        (S, 2), (S,) of the area's sides: ``normal . p >= offset``.
    """

    def __init__(self, problem: NavigationProblem, slots: int, kernels: Kernels = NUMPY) -> None:
        self._kernels, self._footprint = kernels, problem.footprint
        _, _, x_min, x_max = problem.bounds
        sides = [
            (axis, sign, bound)
            for axis in (0, 1)
            for sign, bound in ((1.0, x_min[axis]), (-1.0, x_max[axis]))
            if np.isfinite(bound)
        ]
        self.side_normals = np.zeros((len(sides), 2))
        for row, (axis, sign, _) in zip(self.side_normals, sides, strict=True):
            row[axis] = sign
        self.side_offsets = np.array([sign * bound for _, sign, bound in sides])
        self._distance = problem.body_radius + problem.margin
        self._range = problem.sensor_range
        self.directions = 2 if problem.footprint is None else 3
        self.horizon, self.slots = problem.horizon, slots
        circles = 1 if problem.footprint is None else len(problem.footprint.circles)
        self._times = np.repeat(problem.dt * np.arange(1, problem.horizon + 1), circles)

    def clearances(self, states: Array, things: Array, solids: Nearby | None) -> Clearances:
        """Clearances of stages 1 to N from things, solids, then sides, in this order.

        The last of the sides is the circle within which all is known, where there is one. A robot
        that stands outside the area widens its side to where it stands: it is asked to come
        back, at no obstacle's expense.

        Parameters
        ----------
        states, things : ndarray
            (N + 1, 3), the first being the present one, and (M, 7).
        solids : Nearby, optional
            Solids that the robot can come to.
        """
        points = places_of(self._footprint, states[1:])
        found = []
        if len(things):
            found.append(self._kernels.distances_and_directions(things, points, self._times))
        if solids is not None:
            found.append(solids.measure(points, self._kernels))
        values = [gaps.reshape(self.horizon, -1) - self._distance for gaps, _ in found]
        normals = [self._slopes(away, points, states) for _, away in found]
        count = sum(part.shape[1] for part in values)
        for distances, away in self._sides(states):
            values.append(distances)
            normals.append(np.zeros((*distances.shape, self.directions)))
            normals[-1][..., :2] = away
        return Clearances(np.concatenate(values, axis=1), np.concatenate(normals, axis=1), count)

    def _slopes(self, away: Array, points: Array, states: Array) -> Array:
        """Normals (N, K, directions) of directions (n, M, 2) at points (n, 2).

        Turning moves a circle across its arm.
        """
        if self._footprint is not None:
            arms = points.reshape(self.horizon, -1, 2) - states[1:, None, :2]
            across = np.stack([-arms[..., 1], arms[..., 0]], axis=-1).reshape(-1, 1, 2)
            slopes = (away * across).sum(axis=-1, keepdims=True)
            away = np.concatenate([away, slopes], axis=-1)
        return away.reshape(self.horizon, -1, self.directions)

    def _sides(self, states: Array) -> list[tuple[Array, Array]]:
        """Distances (N, S) [m] and normals of the sides of the area, and of what is known."""
        offsets = np.minimum(self.side_offsets, self.side_normals @ states[0, :2])
        sides = [(states[1:, :2] @ self.side_normals.T - offsets, self.side_normals)]
        if self._range is not None:
            back = states[0, :2] - states[1:, :2]
            distance = np.hypot(back[:, 0], back[:, 1])[:, None]
            normals = (back / np.maximum(distance, LEAST_DISTANCE))[:, None]
            sides.append((self._range - distance, normals))
        return sides

    def half_planes(self, states: Array, clearances: Array, normals: Array) -> tuple[Array, Array]:
        """Nearest half-planes ``normal . p >= offset`` of stages 1 to N.

        Parameters
        ----------
        states, clearances, normals : ndarray
            (N + 1, 3), and what `clearances` gave for them, less margins if there are any.

        Returns
        -------
        normals, offsets : ndarray
            (N, slots, `directions`); (N, slots) [m], minus infinity where a slot is not needed.
        """
        return self._kernels.nearest_half_planes(states, clearances, normals, self.slots)
