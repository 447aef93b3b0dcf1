"""How far a robot's outline itself is from polygons and walls: corner to edge, and edge to corner.

The circles that cover an outline stick out of it, at its ends by a fifth of its width: too much
where a car parks between two others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.world.outlines import Outlines

NEAR = 0.25
"""How near the circles must be for the outline itself to be looked at [radii of a circle]."""
KEPT = 0.1
"""What the outline keeps all the same [radii of a circle]: no robot drives as its model says."""
AT = 1e-9
"""Distance at which a direction cannot be told [m]."""


def sharpen(
    outlines: Outlines, footprint: Footprint, poses: Array, distances: Array, slopes: Array
) -> None:
    """Let no circle be nearer to a solid than the outline that it covers; in place.

    The rows of its circles are those of the points in which it comes nearest then: a corner of one
    and an edge of the other, each with what turning does to it.

    Parameters
    ----------
    outlines : Outlines
        P solids.
    footprint : Footprint
        Covered by C circles.
    poses : ndarray
        (n, 3) of the robot.
    distances, slopes : ndarray
        Of the circles' middles from the solids, (n C, P) [m], and by a pose's coordinates,
        (n C, P, 3).
    """
    if not (len(outlines) and footprint.is_covered_closely):
        return
    count, radius = len(footprint.circles), footprint.circle_radius
    shape = len(poses), count, len(outlines)
    found, away = distances.reshape(shape), slopes.reshape(*shape, 3)
    least = found.min(axis=1)
    nearest = least.min(axis=1)
    # what lies in a circle in the robot touches it, and is as deep as the circles say
    near = (nearest < radius * (1.0 + NEAR)) & (nearest > footprint.core_radius)
    near = np.flatnonzero(near)
    if not len(near):
        return
    whole, directions = outline_gaps(outlines, footprint.outline, poses[near], count)
    # what lies in the robot lies in one of the circles in it
    whole = np.minimum(whole, (least[near] - footprint.core_radius)[:, None])
    whole += radius * (1.0 - KEPT)
    farther = (whole[:, 0] > least[near])[:, None]
    found[near] = np.where(farther, whole, found[near])
    away[near] = np.where(farther[..., None], directions, away[near])


def outline_gaps(
    outlines: Outlines, corners: Array, poses: Array, count: int
) -> tuple[Array, Array]:
    """Distances (n, count, P) of a robot from solids [m], and slopes by its pose (n, count, P, 3).

    Of the points in which they are nearest, corners of one from edges of the other, the first is
    the robot's distance. Below zero where a corner of one lies in the other. Outlines that cross
    without that are not noticed: the circles inside the robot tell them.

    Parameters
    ----------
    outlines : Outlines
        P of them.
    corners : ndarray
        (K, 2) of the convex outline in the robot's frame, counter-clockwise [m].
    poses : ndarray
        (n, 3) of the robot.
    count : int
        How many points, at most K + 1.
    """
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    arms = corners @ turns
    mine, away = outlines.distances((arms + poses[:, None, :2]).reshape(-1, 2))
    shape = len(poses), len(corners), len(outlines)
    mine, away = mine.reshape(shape), away.reshape(*shape, 2)
    arms = np.broadcast_to(arms[:, :, None], (*shape, 2))

    # corners of the solids, as the robot sees them; an edge that is there again tells nothing new
    begins = outlines.begins
    others = np.concatenate([begins, begins[:, :1] + outlines.steps[:, :1]], axis=1)
    again = np.zeros(others.shape[:2], dtype=bool)
    again[:, 1:-1] = (begins[:, 1:] == begins[:, :-1]).all(axis=-1)
    again[:, -1] = ~outlines.is_line
    reach = others - poses[:, None, None, :2]
    theirs, towards = _distances(corners, reach @ turns.transpose(0, 2, 1)[:, None])
    theirs = np.where(again, np.inf, theirs - outlines.rounding[:, None])
    found = np.concatenate([mine, theirs.swapaxes(1, 2)], axis=1)
    away = np.concatenate([away, -(towards @ turns[:, None]).swapaxes(1, 2)], axis=1)
    arms = np.concatenate([arms, reach.swapaxes(1, 2)], axis=1)
    chosen = np.argsort(found, axis=1)[:, :count]
    found, away, arms = (
        np.take_along_axis(found, chosen, 1),
        *(np.take_along_axis(some, chosen[..., None], 1) for some in (away, arms)),
    )
    return found, with_turning(away, arms)


def with_turning(away: Array, arms: Array) -> Array:
    """Slopes (..., 3) by a robot's pose of distances of points on it.

    Parameters
    ----------
    away : ndarray
        Directions in which the points leave what they are near, (..., 2).
    arms : ndarray
        From the robot to the points, (..., 2) [m].
    """
    turn = away[..., 1] * arms[..., 0] - away[..., 0] * arms[..., 1]
    return np.concatenate([away, turn[..., None]], axis=-1)


def _distances(corners: Array, points: Array) -> tuple[Array, Array]:
    """Distances (...) of points (..., 2) from a convex outline (K, 2), and directions (..., 2)."""
    steps = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*steps.T)
    along = steps / lengths[:, None]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    relative = points[..., None, :] - corners
    beyond = (relative * outward).sum(axis=-1)
    share = np.clip((relative * along).sum(axis=-1), 0.0, lengths)
    offsets = relative - share[..., None] * along
    squares = (offsets * offsets).sum(axis=-1)
    edge, deepest = squares.argmin(axis=-1)[..., None], beyond.argmax(axis=-1)[..., None]
    depth = np.take_along_axis(beyond, deepest, -1)[..., 0]
    distance = np.sqrt(np.take_along_axis(squares, edge, -1)[..., 0])
    direction = np.take_along_axis(offsets, edge[..., None], -2)[..., 0, :]
    direction = direction / np.maximum(distance, AT)[..., None]
    inside = depth <= AT
    direction = np.where(inside[..., None], outward[deepest[..., 0]], direction)
    return np.where(inside, depth, distance), direction
