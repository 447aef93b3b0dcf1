"""Half-planes of a robot whose steps are long: the ways between the stages are kept clear, too.

A step that is longer than an obstacle may leap over it, or cut off its edge, though both of its
ends are clear. Here the half-plane of a circle stands where the way to a stage comes nearest to it.
Ways are reckoned straight; what an arc bulges is a margin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.clearance import (
    PLACE,
    RADIUS,
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
)
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.half_planes import LEAST_DISTANCE, Clearances, KeepOut
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.nearby import Nearby

TINY = 1e-24
"""Square of a step that leads nowhere [m^2]."""


class WayKeepOut(KeepOut):
    """What the ways of the robot's centre must stay out of.

    Circles are kept off the ways to the stages, solids and sides off the stages. The first way
    begins where the robot is: where that is nearer than the margin, it must lead no nearer.

    Parameters
    ----------
    problem : NavigationProblem
        As of `KeepOut`, of a round robot.
    slots : int
        Half-planes per stage.
    """

    def __init__(self, problem: NavigationProblem, slots: int) -> None:
        super().__init__(problem, slots)
        self._all_times = problem.dt * np.arange(problem.horizon + 1)
        self._all_shares = np.ones((self.horizon, 0))

    def clearances(self, states: Array, things: Array, solids: Nearby | None) -> Clearances:
        """As of `KeepOut`; from circles on the ways to stages 2 to N."""
        found, count = super().clearances(states, things, solids), len(things)
        self._all_shares = np.ones(found.values.shape)
        if count:
            nearest, self._all_shares[1:, :count] = _nearest(self._away(states, things)[1:])
            length = np.maximum(np.hypot(nearest[..., 0], nearest[..., 1]), LEAST_DISTANCE)
            found.values[1:, :count] = length - self._extents(things)[1:] - self._distance
            found.normals[1:, :count] = nearest / length[..., None]
        return found

    def tighten(
        self, states: Array, things: Array, found: Clearances, margins: Array | float
    ) -> Array:
        """Take margins off, and look at the way of the first step."""
        clearances, count = super().tighten(states, things, found, margins), len(things)
        if count:
            beyond, normals = _first_way(
                self._away(states[:2], things), self._kept(things, margins)
            )
            nearer = beyond < clearances[0, :count]
            clearances[0, :count][nearer] = beyond[nearer]
            found.normals[0, :count][nearer] = normals[nearer]
        return clearances

    def chord_radii(self, circle_count: int, count: int) -> Array:
        """Radii (count,) for the margins of chords: of circles only what arcs bulge is left."""
        radii = np.full(count, self._distance)
        radii[:circle_count] = np.inf
        return radii

    def half_planes(self, states: Array, clearances: Array, normals: Array) -> tuple[Array, Array]:
        """As of `KeepOut`, for points of the ways; `shares` tells which."""
        normals, offsets = super().half_planes(states, clearances, normals)
        steps = states[1:, :2] - states[:-1, :2]
        offsets -= (1.0 - self.shares()) * np.matmul(normals, steps[:, :, None])[..., 0]
        return normals, offsets

    def shares(self) -> Array:
        """Where on the way to its stage each of the last half-planes stands (N, slots), 0 to 1."""
        if self._nearest is not None:
            return self._all_shares.take(self._nearest)
        shares = np.ones((self.horizon, self.slots))
        shares[:, : self._all_shares.shape[1]] = self._all_shares
        return shares

    def bends(self, states: Array, things: Array) -> Array:
        """As of `KeepOut`; a stage moves the nearest point of its way by a share."""
        bends: Array = super().bends(states, things) * self.shares() ** 2
        return bends

    def penetration(
        self,
        states: Array,
        things: Array,
        solids: Nearby | None = None,
        margins: Array | float = 0.0,
    ) -> Array:
        """How deep the ways to stages 1 to N lead into their deepest obstacle, (N,) [m]."""
        deepest, count = super().penetration(states, things, solids, margins), len(things)
        if count:
            away = self._away(states, things)
            nearest, _ = _nearest(away[1:])
            later = margins[1:, :count] if isinstance(margins, np.ndarray) else margins
            radii = self._extents(things)[1:] + self._distance + later
            inside = radii - np.hypot(nearest[..., 0], nearest[..., 1])
            np.maximum(deepest[1:], inside.max(axis=1), out=deepest[1:])
            beyond, _ = _first_way(away[:2], self._kept(things, margins))
            deepest[0] = max(deepest[0], -beyond.min())
        return deepest

    def _away(self, states: Array, things: Array) -> Array:
        """Stages from 0 on, seen from circles, (K + 1, M, 2) [m]."""
        away: Array = states[:, None, :2] - things[:, PLACE]
        away -= self._all_times[: len(states), None, None] * things[:, VELOCITY]
        return away

    def _extents(self, things: Array) -> Array:
        """Radii (N, M) of things at stages 1 to N [m]."""
        radii: Array = things[:, RADIUS] + np.minimum(
            self._times[:, None] * things[:, SPREAD_RATE], things[:, SPREAD_MAX]
        )
        return radii

    def _kept(self, things: Array, margins: Array | float) -> Array:
        """Distances (M,) that the first way is to keep from the circles' centres [m]."""
        first = margins[0, : len(things)] if isinstance(margins, np.ndarray) else margins
        kept: Array = self._extents(things)[0] + self._distance + first
        return kept


def _nearest(away: Array) -> tuple[Array, Array]:
    """Points of straight ways that are nearest to the origin, and where on the way they lie.

    Parameters
    ----------
    away : ndarray
        (K + 1, M, 2) where the ways begin and end [m].

    Returns
    -------
    nearest, shares : ndarray
        (K, M, 2) [m], and (K, M) from 0 to 1.
    """
    begin, step = away[:-1], away[1:] - away[:-1]
    squared = np.maximum((step * step).sum(axis=-1), TINY)
    shares = np.clip(-(begin * step).sum(axis=-1) / squared, 0.0, 1.0)
    return begin + shares[..., None] * step, shares


def _first_way(away: Array, radii: Array) -> tuple[Array, Array]:
    """How far beyond the tangent of each circle a way ends, on the side on which it gets past.

    The nearest point of a way that begins at the circle's edge hardly moves with its end: the
    tangent tells where the end may be.

    Parameters
    ----------
    away : ndarray
        (2, M, 2) where the way begins and ends, seen from the circles' centres [m].
    radii : ndarray
        (M,) of the circles; less where it begins nearer [m].

    Returns
    -------
    beyond, normals : ndarray
        (M,) [m], infinite where the way is nearest at its begin or end, and (M, 2).
    """
    begin, step = away[0], away[1] - away[0]
    distance = np.maximum(np.hypot(begin[:, 0], begin[:, 1]), LEAST_DISTANCE)
    towards = -begin / distance[:, None]
    left = np.column_stack([-towards[:, 1], towards[:, 0]])
    # the tangent leads aside of the centre by the angle of this sine
    sine = np.minimum(radii / distance, 1.0)
    side = np.where((left * step).sum(axis=-1) < 0.0, -1.0, 1.0) * np.sqrt(1.0 - sine * sine)
    normals = side[:, None] * left - sine[:, None] * towards
    ahead = -(begin * step).sum(axis=-1)
    passes = (ahead > 0.0) & (ahead < (step * step).sum(axis=-1))
    return np.where(passes, (normals * step).sum(axis=-1), np.inf), normals
