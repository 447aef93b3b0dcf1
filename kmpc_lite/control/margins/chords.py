"""How much nearer than its samples a path comes to an obstacle, between them."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

WALL_RADIUS = 1e6
"""Radius that a flat wall is reckoned with [m]."""


def chord_margins(states: Array, radii: Array | float, reach: float = 0.0) -> Array:
    """Distances beyond the radii that samples must keep, so that the path between them keeps radii.

    A chord of length L whose ends keep a distance D from a centre comes as near as ``sqrt(D^2 -
    L^2 / 4)``, and an arc that turns by phi bulges beyond its chord by ``L phi / 8``: with ``D =
    sqrt((R + bulge)^2 + L^2 / 4)`` the path stays outside R.

    Parameters
    ----------
    states : ndarray
        (N + 1, 3) [m, m, rad].
    radii : ndarray or float
        Distance of the robot's centre from each obstacle's at touch [m]: (S,), or (N, S), infinite
        for a wall. One number for all: the smallest is safe for the others.
    reach : float
        How far from the pose the point lies that the distances are kept for [m].

    Returns
    -------
    ndarray
        Of stages 1 to N: (N, 1) for one radius, else (N, S) [m].
    """
    steps = np.abs(states[1:] - states[:-1])
    squares = steps[:, 0] ** 2 + steps[:, 1] ** 2
    if reach:
        squares = (np.sqrt(squares) + reach * steps[:, 2]) ** 2
    bulges = np.sqrt(squares) * steps[:, 2] / 8
    squares /= 4
    # a sample ends one chord and begins the next
    np.maximum(squares[:-1], squares[1:], out=squares[:-1])
    np.maximum(bulges[:-1], bulges[1:], out=bulges[:-1])
    if isinstance(radii, float):
        chords: Array = np.sqrt((radii + bulges) ** 2 + squares) - radii
        return chords[:, None]
    radius = np.where(np.isinf(radii), WALL_RADIUS, radii)
    beyond: Array = np.sqrt((radius + bulges[:, None]) ** 2 + squares[:, None]) - radius
    return beyond
