"""The half-planes of a stage: those of the nearest few obstacles and sides, in their order."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array


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
        (N, slots, 2 or 3); (N, slots) [m], minus infinity where a slot is not needed.
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
