"""Rectangles along the axes: how far points are, which way, and which of them matter.

Sizes: n points; B rectangles, at most 16,384.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

AT = 1e-9
"""Distance at which a direction cannot be told [m]."""


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
