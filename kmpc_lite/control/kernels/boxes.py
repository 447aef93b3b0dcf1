"""Rectangles along the axes: how far points are, which way, and which of them matter.

Sizes: n points; B rectangles, at most 16,384.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

AT = 1e-9
"""Distance at which a direction cannot be told [m]."""


def box_distances(low: Array, high: Array, points: Array) -> Array:
    """Distances (n,) of points (n, 2) from the nearest of rectangles [m], negative inside.

    Parameters
    ----------
    low, high : ndarray
        Corners (B, 2) each [m].
    points : ndarray
        (n, 2) [m].
    """
    out: Array = away(low, high, points)[0].min(axis=1)
    return out


def nearest_boxes(
    low: Array, high: Array, points: Array, behind: float, columns: int
) -> tuple[Array, Array, Array]:
    """The rectangles that matter at points: the nearest, then the nearest that is not behind it.

    Parameters
    ----------
    low, high, points : ndarray
        As of `box_distances`.
    behind : float
        How far a rectangle's nearest point may stand out of another one's half-plane and count as
        behind it [m].
    columns : int
        How many are chosen, K, at most B.

    Returns
    -------
    chosen, distances, normals : ndarray
        Their numbers (n, K), distances (n, K) [m], negative inside, and normals (n, K, 2).
    """
    distance, x, y = away(low, high, points)
    count, rows = distance.shape[1], np.arange(len(points))
    if columns == count:
        chosen = np.broadcast_to(np.arange(columns), distance.shape)
    else:
        chosen = np.empty((len(points), columns), dtype=np.intp)
        left = distance.copy()
        for i in range(columns):
            nearest = left.argmin(axis=1)
            chosen[:, i] = nearest
            if i + 1 < columns:
                # what lies behind the nearest one's half-plane, itself included, is done with
                nearest += count * rows
                near = distance.take(nearest)
                along = x * (x.take(nearest) / near)[:, None]
                along += y * (y.take(nearest) / near)[:, None]
                np.putmask(left, along >= (near - behind)[:, None], np.inf)
        place = chosen + (count * rows)[:, None]
        distance, x, y = distance.take(place), x.take(place), y.take(place)
    return chosen, distance, np.stack([x / distance, y / distance], axis=-1)


def away(low: Array, high: Array, points: Array) -> tuple[Array, Array, Array]:
    """Distances (n, B) [m], negative inside, and x and y (n, B) of the normals times them."""
    here_x, here_y = points[:, :1], points[:, 1:]
    x = here_x - np.minimum(np.maximum(here_x, low[:, 0]), high[:, 0])
    y = here_y - np.minimum(np.maximum(here_y, low[:, 1]), high[:, 1])
    distance = np.sqrt(x * x + y * y)
    if distance.min(initial=1.0) <= AT:
        sides = np.stack(
            [here_x - low[:, 0], here_y - low[:, 1], high[:, 0] - here_x, high[:, 1] - here_y],
            axis=-1,
        )
        inside, side = distance <= AT, sides.argmin(axis=-1)
        # a side that is touched still has a direction
        distance = np.where(inside, np.minimum(-sides.min(axis=-1), -AT), distance)
        x = np.where(inside, distance * np.array([-1.0, 0.0, 1.0, 0.0])[side], x)
        y = np.where(inside, distance * np.array([0.0, -1.0, 0.0, 1.0])[side], y)
    return distance, x, y
