"""How far a robot's outline itself is from polygons and walls: corner to edge, and edge to corner.

The circles that cover an outline stick out of it, at its ends by a fifth of its width: too much
where a car parks between two others.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.world.outlines import Outlines
from kmpc_lite.types import Array

NEAR = 0.25
"""How near the circles must be for the outline itself to be looked at [radii of a circle]."""
KEPT = 0.1
"""What the outline keeps all the same [radii of a circle]: no robot drives as its model says."""


def sharpen(
    outlines: Outlines, footprint: Footprint, poses: Array, distances: Array, slopes: Array
) -> None:
    """Let no circle be nearer to a solid than the outline that it covers; in place.

    The rows of its circles are those of the points in which it comes nearest then: a corner of one
    and an edge of the other, each with what turning does to it.

    `outlines`: p solids. `footprint`: covered by C circles. `poses`: (n, 3) of the robot.
    `distances`, `slopes`: of the circles' middles from the solids, (n C, P) [m], and by a pose's
    coordinates, (n C, P, 3).
    """
    if not (len(outlines) and footprint.is_covered_closely):
        return
    count, radius = len(footprint.circles), footprint.circle_radius
    shape = len(poses), count, len(outlines)
    found, away = distances.reshape(shape), slopes.reshape(*shape, 3)
    least = found.min(axis=1)
    nearest = least.min(axis=1)
    # what lies in a circle in the robot touches it, and is as deep as the circles say
    is_near = (nearest < radius * (1.0 + NEAR)) & (nearest > footprint.core_radius)
    if not len(near := np.flatnonzero(is_near)):
        return
    whole, directions = outline_gaps(outlines, footprint, poses[near], count)
    # what lies in the robot lies in one of the circles in it
    whole = np.minimum(whole, (least[near] - footprint.core_radius)[:, None])
    whole += radius * (1.0 - KEPT)
    farther = (whole[:, 0] > least[near])[:, None]
    found[near] = np.where(farther, whole, found[near])
    away[near] = np.where(farther[..., None], directions, away[near])


def outline_gaps(
    outlines: Outlines, footprint: Footprint, poses: Array, count: int
) -> tuple[Array, Array]:
    """Distances (n, count, P) of a robot from solids [m], and slopes by its pose (n, count, P, 3).

    Of the points in which they are nearest, corners of one from edges of the other, the first is
    the robot's distance. Below zero where a corner of one lies in the other. Outlines that cross
    without that are not noticed: the circles inside the robot tell them.

    `outlines`: p of them. `footprint`: the robot's outline, of K corners. `poses`: (n, 3) of the
    robot. `count`: how many points, at most K + 1.
    """
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    arms = footprint.outline @ turns
    mine, away = outlines.distances((arms + poses[:, None, :2]).reshape(-1, 2))
    shape = len(poses), len(footprint.outline), len(outlines)
    slopes = with_turning(away.reshape(*shape, 2), arms[:, :, None])
    # corners of the solids, as the robot sees them; an edge that is there again tells nothing new
    begins = outlines.begins
    others = np.concatenate([begins, begins[:, :1] + outlines.steps[:, :1]], axis=1)
    again = np.zeros(others.shape[:2], dtype=bool)
    again[:, 1:-1] = (begins[:, 1:] == begins[:, :-1]).all(axis=-1)
    again[:, -1] = ~outlines.is_line
    reach = others - poses[:, None, None, :2]
    seen = reach @ turns.transpose(0, 2, 1)[:, None]
    theirs, towards = _body(footprint).distances(seen.reshape(-1, 2))
    away = -(towards.reshape(seen.shape) @ turns[:, None])
    theirs = np.where(again, np.inf, theirs.reshape(seen.shape[:-1]) - outlines.rounding[:, None])
    found = np.concatenate([mine.reshape(shape), theirs.swapaxes(1, 2)], axis=1)
    slopes = np.concatenate([slopes, with_turning(away, reach).swapaxes(1, 2)], axis=1)
    chosen = np.argsort(found, axis=1)[:, :count]
    nearest = np.take_along_axis(found, chosen, 1)
    return nearest, np.take_along_axis(slopes, chosen[..., None], 1)


def with_turning(away: Array, arms: Array) -> Array:
    """Slopes (..., 3) by a robot's pose of distances of points on it.

    `away`: directions in which the points leave what they are near, (..., 2). `arms`: from the
    robot to the points, (..., 2) [m].
    """
    turn = away[..., 1] * arms[..., 0] - away[..., 0] * arms[..., 1]
    return np.concatenate([away, turn[..., None]], axis=-1)


@lru_cache(maxsize=8)
def _body(footprint: Footprint) -> Outlines:
    """The robot's outline in its own frame, as distances from it are asked for."""
    corners = footprint.outline[None]
    steps = np.roll(corners, -1, axis=1) - corners
    return Outlines(corners, steps, np.zeros(1), np.zeros(1, dtype=bool))
