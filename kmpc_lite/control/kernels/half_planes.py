"""The half-planes of a plan: what it must be kept out of, and the nearest few of each stage.

A circle, a polygon, a wall or a cell of a grid lies behind the half-plane through its nearest
point, across the direction from there to the robot. Columns are those of the first circle of the
robot's outline, then of the next, and so on: for all things, then for all solids; the sides of the
area are kept from the pose alone. Sizes: N stages, at most 50; E circles; M things; S solids.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.kernels.clearance import distances_and_directions
from kmpc_lite.types import Array

LEAST_DISTANCE = 1e-9
"""Distance from the robot below which there is no direction towards it [m]."""


class KeepOut(NamedTuple):
    """What follows from the problem."""

    distance: float
    """Radius of the outline's circles, and the problem's margin [m]."""
    dt: float
    """Period [s]."""
    range: float
    """How far from the robot all is known [m]; infinite if it always is."""
    side_normals: Array
    """(sides, 2) of the area's sides ``normal . p >= offset`` ..."""
    side_offsets: Array
    """(sides,) ... and how far out they lie [m]."""
    directions: int
    """By how many of a state's coordinates a clearance has slopes: x, y, and the heading of a robot
    that is not round."""
    slots: int
    """Half-planes a stage, at most 16."""


def clearances(
    keep: KeepOut, states: Array, things: Array, points: Array, gaps: Array, away: Array
) -> tuple[Array, Array]:
    """Clearances (N, K) [m] of stages 1 to N, and normals (N, K, directions) away from them.

    Of things, solids, then sides. The last of the sides is the circle within which all is known,
    if there is one. A robot that stands outside the area widens its side to where it stands: it is
    asked to come back, at no obstacle's expense.

    Parameters
    ----------
    states, things : ndarray
        (N + 1, 3), the first being the present one, and (M, 7).
    points : ndarray
        (N E, 2) middles of the outline's circles at stages 1 to N.
    gaps, away : ndarray
        (N E, S) distances of these from solids [m], (N E, S, 2) directions away from them.
    """
    stages = len(states) - 1
    times = (keep.dt * np.arange(1, stages + 1)).repeat(len(points) // stages)
    distances, directions = distances_and_directions(things, points, times)
    values = [found.reshape(stages, -1) - keep.distance for found in (distances, gaps)]
    normals = [_slopes(keep, found, points, states) for found in (directions, away)]
    for distance, normal in _sides(keep, states):
        values.append(distance)
        normals.append(np.zeros((*distance.shape, keep.directions)))
        normals[-1][..., :2] = normal
    return np.concatenate(values, axis=1), np.concatenate(normals, axis=1)


def _slopes(keep: KeepOut, away: Array, points: Array, states: Array) -> Array:
    """Normals (N, K, directions) of directions (N E, K, 2) at points (N E, 2).

    Turning moves a circle across its arm.
    """
    stages = len(states) - 1
    if keep.directions > 2:
        arms = points.reshape(stages, -1, 2) - states[1:, None, :2]
        across = np.stack([-arms[..., 1], arms[..., 0]], axis=-1).reshape(-1, 1, 2)
        slopes = (away * across).sum(axis=-1, keepdims=True)
        away = np.concatenate([away, slopes], axis=-1)
    return away.reshape(stages, len(points) // stages * away.shape[1], keep.directions)


def _sides(keep: KeepOut, states: Array) -> list[tuple[Array, Array]]:
    """Distances (N, sides) [m] and normals of the sides of the area, and of what is known."""
    offsets = np.minimum(keep.side_offsets, keep.side_normals @ states[0, :2])
    sides = [(states[1:, :2] @ keep.side_normals.T - offsets, keep.side_normals)]
    if keep.range < math.inf:
        back = states[0, :2] - states[1:, :2]
        distance = np.hypot(back[:, 0], back[:, 1])[:, None]
        normals = (back / np.maximum(distance, LEAST_DISTANCE))[:, None]
        sides.append((keep.range - distance, normals))
    return sides


def nearest_half_planes(
    states: Array, clearances: Array, normals: Array, slots: int
) -> tuple[Array, Array]:
    """Half-planes ``normal . x >= offset`` of stages 1 to N.

    In the order of the obstacles, so that a row keeps its obstacle, and its multiplier, from pass
    to pass.

    Parameters
    ----------
    states : ndarray
        (N + 1, 3), N at most 50.
    clearances, normals : ndarray
        Of stages 1 to N from K obstacles and sides, less margins: (N, K) [m] and (N, K, 2), or
        (N, K, 3) with the slope by the heading.
    slots : int
        Half-planes a stage, at most 16.

    Returns
    -------
    normals, offsets : ndarray
        (N, slots, 2 or 3); (N, slots) [m], minus infinity if a slot is not needed.
    """
    stages, kinds = clearances.shape
    if kinds > slots:
        nearest = np.argsort(clearances, axis=1, kind="stable")[:, :slots]
        nearest.sort(axis=1)
        clearances = np.take_along_axis(clearances, nearest, axis=1)
        normals = np.take_along_axis(normals, nearest[..., None], axis=1)
    directions = normals.shape[2]
    offsets = np.matmul(normals, states[1:, :directions, None])[..., 0] - clearances
    if kinds >= slots:
        return normals, offsets
    all_normals, all_offsets = (
        np.zeros((stages, slots, directions)),
        np.full((stages, slots), -np.inf),
    )
    all_normals[:, :kinds], all_offsets[:, :kinds] = normals, offsets
    return all_normals, all_offsets
