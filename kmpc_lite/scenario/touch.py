"""Whether a robot has arrived, or touches something: the truth that a simulated drive is judged by.

Outline to outline, not by its circles: it shares nothing with what the controller reckons with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import corners_of
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Wall
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.types import Array

LOOKS = 10  # how often in a period studies of their own loops look for collisions
SHORT = 1e-12
"""Square of an edge without a length [m^2]: corners that are there twice, ends of walls."""


@dataclass(frozen=True)
class Tolerance:
    """How far from its goal a robot may be and be there."""

    distance: float  # [m]
    heading: float  # [rad]

    def met(self, poses: Array, goal: Array) -> NDArray[np.bool_]:
        """Whether poses (..., 3) are within both of a goal (3,), (...).

        Examples
        --------
        >>> poses = np.array([[0.0, 0.04, 6.2], [0.0, 0.06, 0.0], [0.0, 0.0, 0.2]])
        >>> ARRIVED.met(poses, np.zeros(3)).tolist()
        [True, False, False]
        """
        near = distances(poses, goal) <= self.distance
        turned = np.abs(wrap(poses[..., 2] - goal[2])) <= self.heading
        return np.asarray(near & turned)


ARRIVED = Tolerance(0.05, 0.15)
"""Of the paper's table, and of a scenario that does not say otherwise."""


def in_pose(radius: float, spread: Array) -> Tolerance:
    """Tolerance of a robot of any size: a tenth of its radius [m], and 0.1 rad.

    Measured poses that err by more, of standard deviations (3,) [m, m, rad], widen it: to three of
    them.
    """
    return Tolerance(max(0.1 * radius, 3.0 * float(spread[0])), max(0.1, 3.0 * float(spread[2])))


def footprint_gaps(
    footprint: Footprint, poses: Array, circles: Array, solids: Sequence[Solid]
) -> Array:
    """Distances (n,) of a robot from its nearest obstacle [m]; negative where they overlap.

    `footprint`: of the robot. `poses`: (n, 3) [m, m, rad]. `circles`: (n, M, 3) or longer rows x,
    y, radius: where they are at each pose [m]. `solids`: at rest.

    Examples
    --------
    >>> cart, ahead = Footprint.rectangle(0.8, 0.3), np.array([[[1.0, 0.0, 0.2]]])
    >>> footprint_gaps(cart, np.array([[0.0, 0.0, 0.0]]), ahead, []).round(3)
    array([0.4])
    """
    robots = np.array([footprint.at(pose) for pose in poses])
    gaps = np.full(len(poses), np.inf)
    if circles.shape[1]:
        apart = _apart(robots, circles[:, :, None, :2]) - circles[..., 2]
        gaps = np.minimum(gaps, apart.min(axis=1))
    for solid in solids:
        if isinstance(solid, OccupancyGrid):
            if not len(rectangles := solid.rectangles):
                continue
            low, high = rectangles[:, :2], rectangles[:, 2:]
            around = np.stack([low, np.stack([high[:, 0], low[:, 1]], 1), high], axis=1)
            last = np.stack([low[:, 0], high[:, 1]], 1)[:, None]
            corners, rounding = solid.to_map(np.concatenate([around, last], axis=1)), 0.0
        else:
            corners = corners_of(solid)[None]
            rounding = 0.5 * solid.thickness if isinstance(solid, Wall) else 0.0
        apart = _apart(robots, np.broadcast_to(corners, (len(poses), *corners.shape)))
        gaps = np.minimum(gaps, apart.min(axis=1) - rounding)
    return gaps


def _apart(robots: Array, others: Array) -> Array:
    """Distances (n, P) of convex outlines (n, K, 2) and (n, P, E, 2) [m], counter-clockwise.

    Where they overlap: by how far the shallowest way out leads, below zero. An outline of one
    corner is a point, one of two a line.
    """
    mine = robots[:, None]
    depth = np.maximum(_beyond(mine, others), _beyond(others, mine))
    nearest = np.minimum(_to_edges(others, mine), _to_edges(mine, others))
    out: Array = np.where(depth < 0.0, depth, nearest)
    return out


def _beyond(outline: Array, points: Array) -> Array:
    """How far all points (..., E, 2) lie beyond the edge of an outline that leaves most, (...)."""
    steps = np.roll(outline, -1, axis=-2) - outline
    squares = (steps * steps).sum(axis=-1)
    outward = np.stack([steps[..., 1], -steps[..., 0]], axis=-1)
    outward /= np.sqrt(np.maximum(squares, SHORT))[..., None]
    away = points[..., None, :, :] - outline[..., :, None, :]
    least = (away * outward[..., None, :]).sum(axis=-1).min(axis=-1)
    return np.asarray(np.where(squares > SHORT, least, -np.inf).max(axis=-1))


def _to_edges(points: Array, outline: Array) -> Array:
    """Least distance (...) of points (..., E, 2) from the edges of an outline (..., K, 2)."""
    begin, steps = outline, np.roll(outline, -1, axis=-2) - outline
    squares = np.maximum((steps * steps).sum(axis=-1), SHORT)
    away = points[..., :, None, :] - begin[..., None, :, :]
    share = (away * steps[..., None, :, :]).sum(axis=-1) / squares[..., None, :]
    away = away - np.clip(share, 0.0, 1.0)[..., None] * steps[..., None, :, :]
    return np.asarray(np.hypot(away[..., 0], away[..., 1]).min(axis=(-2, -1)))
