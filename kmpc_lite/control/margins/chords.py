"""How much nearer than its samples a path comes to an obstacle, between them."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.types import Array

TINY = 1e-24
"""Square of a step that leads nowhere [m^2]."""
WALL_RADIUS = 1e6
"""Radius that a flat wall is reckoned with [m]."""


def halves(step: Array) -> tuple[Array, Array, float]:
    """Cut an arc in two.

    Parameters
    ----------
    step : ndarray
        From its begin to its end (3,) [m, m, rad].

    Returns
    -------
    first, second : ndarray
        Chords of its halves (2,) [m].
    bulge : float
        How far either half comes beyond its chord [m].
    """
    x, y, turn = step.tolist()
    # the middle of the arc lies L phi / 8 beside that of its chord
    first = np.array((0.5 * x + turn / 8.0 * y, 0.5 * y - turn / 8.0 * x))
    return first, step[:2] - first, math.hypot(x, y) * abs(turn) / 32.0


def least_on_way(away: Array, step: Array) -> Array:
    """Least distance from a point on the straight way of a step, where it began left out [m].

    So one that leads away from the point is as far as its end.

    Parameters
    ----------
    away : ndarray
        (..., 2) from the point to where the step begins [m].
    step : ndarray
        (..., 2) [m].
    """
    towards = -(away * step).sum(axis=-1)
    squared = np.maximum((step * step).sum(axis=-1), TINY)
    share = np.where(towards > 0.0, np.minimum(towards / squared, 1.0), 1.0)
    nearest = away + share[..., None] * step
    out: Array = np.hypot(nearest[..., 0], nearest[..., 1])
    return out


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
