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
    outlines: Outlines, footprint: Footprint, poses: Array, distances: Array, normals: Array
) -> None:
    """Let no circle be nearer to a solid than the outline that it covers; in place.

    Parameters
    ----------
    outlines : Outlines
        P solids.
    footprint : Footprint
        Covered by C circles.
    poses : ndarray
        (n, 3) of the robot.
    distances, normals : ndarray
        Of the circles' middles from the solids, (n C, P) [m], and away from them, (n C, P, 2).
    """
    if not (len(outlines) and footprint.is_covered_closely):
        return
    radius, shape = footprint.circle_radius, (len(poses), -1, len(outlines))
    found, away = distances.reshape(shape), normals.reshape(*shape, 2)
    least = found.min(axis=1)
    nearest = least.min(axis=1)
    # what lies in a circle in the robot touches it, and is as deep as the circles say
    near = (nearest < radius * (1.0 + NEAR)) & (nearest > footprint.core_radius)
    near = np.flatnonzero(near)
    if not len(near):
        return
    whole, directions = outline_gaps(outlines, footprint.outline, poses[near])
    # what lies in the robot lies in one of the circles in it
    whole = np.minimum(whole, least[near] - footprint.core_radius)[:, None]
    whole += radius * (1.0 - KEPT)
    farther = whole > found[near]
    found[near] = np.where(farther, whole, found[near])
    away[near] = np.where(farther[..., None], directions[:, None], away[near])


def outline_gaps(outlines: Outlines, corners: Array, poses: Array) -> tuple[Array, Array]:
    """Distances (n, P) of a robot from solids [m], and directions (n, P, 2) away from them.

    Below zero where a corner of one lies in the other. Outlines that cross without that are not
    noticed: the circles inside the robot tell them.

    Parameters
    ----------
    outlines : Outlines
        P of them.
    corners : ndarray
        (K, 2) of the convex outline in the robot's frame, counter-clockwise [m].
    poses : ndarray
        (n, 3) of the robot.
    """
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    places = corners @ turns + poses[:, None, :2]
    found, normals = outlines.distances(places.reshape(-1, 2))
    shape = len(poses), len(corners), -1
    found, normals = found.reshape(shape), normals.reshape(*shape, 2)
    nearest = found.argmin(axis=1)[:, None]
    mine = np.take_along_axis(found, nearest, 1)[:, 0]
    away = np.take_along_axis(normals, nearest[..., None], 1)[:, 0]

    # corners of the solids, as the robot sees them
    ends = outlines.begins[:, :1] + outlines.steps[:, :1]
    others = np.concatenate([outlines.begins, ends], axis=1)
    seen = (others - poses[:, None, None, :2]) @ turns.transpose(0, 2, 1)[:, None]
    theirs, towards = _distances(corners, seen)
    nearest = theirs.argmin(axis=2)[..., None]
    theirs = np.take_along_axis(theirs, nearest, 2)[..., 0] - outlines.rounding
    towards = np.take_along_axis(towards, nearest[..., None], 2)[:, :, 0]
    nearer = theirs < mine
    away = np.where(nearer[..., None], -towards @ turns, away)
    return np.where(nearer, theirs, mine), away


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
