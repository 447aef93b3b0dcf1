"""Obstacles, and the distances and normals that the QP needs of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Nearby

COLUMNS = 5
STAND_IN = 50.0
"""Radius of a circle that stands for a flat side [m]."""


class _CircleFields(NamedTuple):
    x: float
    y: float
    radius: float
    vx: float
    vy: float


class Circle(_CircleFields):
    """A round obstacle, moving at constant velocity.

    Parameters
    ----------
    x, y : float
        Centre [m].
    radius : float
        >= 0 [m].
    vx, vy : float
        Velocity [m/s].

    Raises
    ------
    ProblemError
        For a negative radius, or values that are not finite.

    Examples
    --------
    >>> Circle(0.5, 0.5, 0.15)
    Circle(x=0.5, y=0.5, radius=0.15, vx=0.0, vy=0.0)
    """

    __slots__ = ()

    def __new__(cls, x: float, y: float, radius: float, vx: float = 0.0, vy: float = 0.0) -> Circle:
        """Check and make a circle."""
        values = (float(x), float(y), float(radius), float(vx), float(vy))
        if not np.isfinite(values).all():
            raise ProblemError(f"circle: expected finite numbers, got {values}")
        if values[2] < 0.0:
            raise ProblemError(
                f"circle at ({values[0]:g}, {values[1]:g}): expected a radius >= 0 m, got {values[2]:g}"
            )
        return super().__new__(cls, *values)


def circles_to_array(obstacles: Sequence[Circle] | ArrayLike) -> Array:
    """Rows x, y, radius, vx, vy, (M, 5), from circles or from an array (M, 3) or (M, 5).

    Raises
    ------
    ValueError
        For other shapes. Values are not looked at: what arrives while driving must not raise.
    """
    if isinstance(obstacles, Sequence) and not len(obstacles):
        return np.empty((0, COLUMNS))
    try:
        array = np.asarray(obstacles, dtype=float)
    except TypeError as error:
        raise ValueError(f"obstacles: expected circles or an array of them: {error}") from error
    if array.ndim == 2 and array.shape[1] == 3:
        array = np.hstack([array, np.zeros((len(array), 2))])
    if array.ndim != 2 or array.shape[1] != COLUMNS:
        raise ValueError(
            f"obstacles: expected circles, or an array (M, 3) or (M, {COLUMNS}) of x, y, radius, vx, vy; got shape {array.shape}"
        )
    return array


def circle_distances(circles: Array, positions: Array, times: Array) -> tuple[Array, Array]:
    """Distances to the circles' edges and the directions away from them.

    Parameters
    ----------
    circles : ndarray
        (M, 5).
    positions, times : ndarray
        (n, 2) [m] and (n,) [s], from now.

    Returns
    -------
    distances, normals : ndarray
        (n, M) [m], negative inside, and (n, M, 2); a normal at a centre is arbitrary.
    """
    away = positions[:, None, :] - circles[:, :2]
    if circles[:, 3:].any():
        away -= times[:, None, None] * circles[:, 3:]
    length = np.hypot(away[..., 0], away[..., 1])
    if length.min() < 1e-9:
        at_centre = length < 1e-9
        away[at_centre] = (1e-9, 0.0)
        length[at_centre] = 1e-9
    away /= length[..., None]
    return length - circles[:, 2], away


def stand_ins(point: Array, distance: Array, normals: Array) -> Array:
    """Circles (C, 5) at rest, of `STAND_IN` radius, that touch what lies at distances (C,) against normals (C, 2) from a point (2,)."""
    circles = np.zeros((len(distance), 5))
    circles[:, :2] = point - (distance + STAND_IN)[:, None] * normals
    circles[:, 2] = STAND_IN
    return circles


class KeepOut:
    """What the robot's centre must stay out of: circles and solids grown by radius and margin, and beyond the sides of the area.

    Holds the memory for one problem; what it returns is overwritten by the next call. `solids`, if
    there are any, are set before the passes of a step.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, radius, margin, horizon.
    slots : int
        Half-planes per stage: the nearest of all obstacles and sides.
    """

    def __init__(self, problem: NavigationProblem, slots: int) -> None:
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
        self._distance = problem.robot_radius + problem.margin
        self.horizon, self.slots = problem.horizon, slots
        self._times = problem.dt * np.arange(1, problem.horizon + 1)
        self.solids: Nearby | None = None
        self.solids_ahead = np.zeros(2), np.empty(0), np.empty((0, 2))
        """Place (2,) of stage 1 when `gaps` was called last, distances (C,) of the solids from it,
        and normals (C, 2)."""
        self._count = -1
        self._row_starts = np.arange(problem.horizon)[:, None]
        self._nearest: Array | None = None
        self._normals, self._offsets = (
            np.zeros((self.horizon, slots, 2)),
            np.full((self.horizon, slots), -np.inf),
        )

    def obstacle_count(self, circles: Array) -> int:
        """How many of the columns of `gaps` are obstacles: all but the sides."""
        return len(circles) + (0 if self.solids is None else self.solids.columns)

    def gaps(self, states: Array, circles: Array) -> tuple[Array, Array]:
        """Room left at stages 1 to N, (N, K) [m], negative where there is none, and normals (N, K, 2): circles, solids, then sides.

        A robot that stands outside the area widens its side to where it stands: it is asked to come
        back, at no obstacle's expense.

        Parameters
        ----------
        states, circles : ndarray
            (N + 1, 3), the first being the present one, and (M, 5).
        """
        circle_count = len(circles)
        count = self.obstacle_count(circles)
        if count != self._count:
            self._count = count
            self._gaps = np.empty((self.horizon, count + len(self._side_offsets)))
            self._gap_normals = np.empty((*self._gaps.shape, 2))
            self._gap_normals[:, count:] = self._side_normals
        positions = states[1:, :2]
        if circle_count:
            distances, self._gap_normals[:, :circle_count] = circle_distances(
                circles, positions, self._times
            )
            np.subtract(distances, self._distance, out=self._gaps[:, :circle_count])
        if self.solids is not None:
            distances, self._gap_normals[:, circle_count:count] = self.solids.measure(positions)
            np.subtract(distances, self._distance, out=self._gaps[:, circle_count:count])
            self.solids_ahead = (
                positions[0].copy(),
                distances[0],
                self._gap_normals[0, circle_count:count],
            )
        np.subtract(
            positions @ self._side_normals.T,
            self._side_offsets_from(states[0]),
            out=self._gaps[:, count:],
        )
        return self._gaps, self._gap_normals

    def _side_offsets_from(self, present: Array) -> Array:
        """Offsets of the sides (sides,) for a robot that is at `present` (3,)."""
        offsets: Array = np.minimum(self._side_offsets, self._side_normals @ present[:2])
        return offsets

    def half_planes(self, states: Array, gaps: Array, normals: Array) -> tuple[Array, Array]:
        """Nearest half-planes ``normal . p >= offset`` of stages 1 to N.

        Parameters
        ----------
        states, gaps, normals : ndarray
            (N + 1, 3), and what `gaps` gave for them, less margins if there are any.

        Returns
        -------
        normals, offsets : ndarray
            (N, slots, 2); (N, slots) [m], minus infinity where a slot is not needed.
        """
        kinds = gaps.shape[1]
        used = min(kinds, self.slots)
        self._nearest = None
        if kinds > self.slots:
            # in the order of the obstacles, so that a row keeps its obstacle, and its multiplier,
            # from pass to pass
            nearest = np.argpartition(gaps, self.slots - 1, axis=1)[:, : self.slots]
            nearest.sort(axis=1)
            nearest += kinds * self._row_starts
            self._nearest = nearest
            gaps = gaps.take(nearest)
            normals = normals.reshape(-1, 2).take(nearest, axis=0)
        offsets = np.matmul(normals, states[1:, :2, None])[..., 0]
        offsets -= gaps
        if used == self.slots:
            return normals, offsets
        self._normals[:, :used], self._offsets[:, :used] = normals, offsets
        self._normals[:, used:], self._offsets[:, used:] = 0.0, -np.inf
        return self._normals, self._offsets

    def bends(self, states: Array, circles: Array) -> Array:
        """How much the half-planes that were given last turn per metre along their obstacles, (N, slots) [1/m]: sides do not.

        Nor do solids here: edges are straight, and where a plan goes round a corner the next pass
        sees it.
        """
        bends = np.zeros(self._gaps.shape)
        if len(circles):
            distances, _ = circle_distances(circles, states[1:, :2], self._times)
            bends[:, : len(circles)] = 1.0 / np.maximum(distances + circles[:, 2], 1e-3)
        if self._nearest is not None:
            return bends.take(self._nearest)
        out = np.zeros((self.horizon, self.slots))
        out[:, : bends.shape[1]] = bends
        return out

    def penetration(self, states: Array, circles: Array, margins: Array | float = 0.0) -> Array:
        """How far each of stages 1 to N stands inside its deepest obstacle or outside the area, (N,) [m]; `gaps` without normals.

        `margins` (N, K) [m] are added to what must be kept.
        """
        count = len(circles)
        outside = self._side_offsets_from(states[0]) - states[1:, :2] @ self._side_normals.T
        x, y = states[1:, 0:1], states[1:, 1:2]
        if self.solids is not None:
            # as far as the last linearisation saw them
            outside = np.concatenate(
                [self._distance - self.solids.again(states[1:, :2]), outside], axis=1
            )
        if count:
            if circles[:, 3:].any():
                x, y = (
                    x - self._times[:, None] * circles[:, 3],
                    y - self._times[:, None] * circles[:, 4],
                )
            inside = circles[:, 2] + self._distance - np.hypot(x - circles[:, 0], y - circles[:, 1])
            outside = np.concatenate([inside, outside], axis=1)
        deepest: Array = (outside + margins).max(axis=1, initial=0.0)
        return deepest
