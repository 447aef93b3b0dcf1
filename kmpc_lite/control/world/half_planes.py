"""How obstacles enter the QP: each as the half-plane that its nearest point stands for.

A circle, a polygon, a wall or a cell of a grid lies behind the half-plane through its nearest
point, across the direction from there to the robot. The QP keeps each stage out of the nearest few.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.nearby import Nearby

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
    """What the robot's centre must stay out of: obstacles and the outside of the area.

    Obstacles are circles and solids, grown by the robot's radius and the problem's margin. Holds
    the memory for one problem; what it returns is overwritten by the next call.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, radius, margin, horizon.
    slots : int
        Half-planes per stage: the nearest of all obstacles and sides.
    kernels : Kernels
        Measure and choose.
    """

    directions = 2
    """By how many of a state's coordinates a clearance has slopes: x and y."""

    def __init__(self, problem: NavigationProblem, slots: int, kernels: Kernels = NUMPY) -> None:
        self._kernels = kernels
        _, _, x_min, x_max = problem.bounds
        sides = [
            (axis, sign, bound)
            for axis in (0, 1)
            for sign, bound in ((1.0, x_min[axis]), (-1.0, x_max[axis]))
            if np.isfinite(bound)
        ]
        self._side_normals = np.array(
            [[sign if axis == i else 0.0 for i in (0, 1)] for axis, sign, _ in sides]
        ).reshape(-1, 2)
        self._side_offsets = np.array([sign * bound for _, sign, bound in sides])
        self._distance = problem.body_radius + problem.margin
        self._range = problem.sensor_range
        self._side_count = len(sides) + (self._range is not None)
        self.horizon, self.slots = problem.horizon, slots
        self._times = problem.dt * np.arange(1, problem.horizon + 1)
        self._count = -1

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
        thing_count = len(things)
        count = thing_count + (0 if solids is None else solids.columns)
        if count != self._count:
            self._count = count
            self._values = np.empty((self.horizon, count + self._side_count))
            self._all_normals = np.empty((*self._values.shape, 2))
            self._all_normals[:, count : count + len(self._side_offsets)] = self._side_normals
        positions = states[1:, :2]
        if thing_count:
            gaps, self._all_normals[:, :thing_count] = self._kernels.distances_and_directions(
                things, positions, self._times
            )
            np.subtract(gaps, self._distance, out=self._values[:, :thing_count])
        if solids is not None:
            gaps, self._all_normals[:, thing_count:count] = solids.measure(positions)
            np.subtract(gaps, self._distance, out=self._values[:, thing_count:count])
        np.subtract(
            positions @ self._side_normals.T,
            self._side_offsets_from(states[0]),
            out=self._values[:, count : count + len(self._side_offsets)],
        )
        if self._range is not None:
            away = states[0, :2] - positions
            distance = np.hypot(away[:, 0], away[:, 1])
            self._values[:, -1] = self._range - distance
            self._all_normals[:, -1] = away / np.maximum(distance, LEAST_DISTANCE)[:, None]
        return Clearances(self._values, self._all_normals, count)

    def _side_offsets_from(self, present: Array) -> Array:
        """Offsets of the sides (sides,) for a robot that is at `present` (3,)."""
        offsets: Array = np.minimum(self._side_offsets, self._side_normals @ present[:2])
        return offsets

    def _outside(self, states: Array) -> Array:
        """How far stages 1 to N lie beyond the sides (N, sides) [m]."""
        beyond: Array = self._side_offsets_from(states[0]) - states[1:, :2] @ self._side_normals.T
        if self._range is not None:
            away = states[1:, :2] - states[0, :2]
            farther = np.hypot(away[:, 0], away[:, 1]) - self._range
            beyond = np.concatenate([beyond, farther[:, None]], axis=1)
        return beyond

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


def keep_out(problem: NavigationProblem, slots: int, kernels: Kernels = NUMPY) -> KeepOut:
    """What a robot must stay out of, with so many half-planes per stage."""
    if problem.footprint is None:
        return KeepOut(problem, slots, kernels)
    # here, since most robots are round
    from kmpc_lite.control.world.body_half_planes import BodyKeepOut

    return BodyKeepOut(problem, problem.footprint, slots, kernels)
