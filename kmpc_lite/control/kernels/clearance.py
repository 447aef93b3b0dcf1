"""What can be where, and when: distances from a table of things, each a disc that moves and grows.

Everything round that may be hit is a row of one table (M, 7): x, y, radius [m], vx, vy [m/s], how
fast it spreads [m/s], and by how much at the most [m]. At time t it lies within
``radius + min(spread_rate * t, spread_max)`` of ``centre + velocity * t``. What is given to stand
has zeros; what was seen to move spreads by what is not known of its velocity.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

COLUMNS = 7
RADIUS, SPREAD_RATE, SPREAD_MAX = 2, 5, 6
PLACE, VELOCITY, SPREAD = slice(0, 2), slice(3, 5), slice(5, 7)
AT_CENTRE = 1e-9
"""Distance from a centre below which there is no direction away from it [m]."""


def things_of(circles: Array, spread_rate: Array | float = 0.0, most: float = 0.0) -> Array:
    """Things (M, 7) of circles (M, 5) that spread at a rate (M,) [m/s], up to a length [m]."""
    things = np.zeros((len(circles), COLUMNS))
    things[:, :SPREAD_RATE] = circles
    things[:, SPREAD_RATE] = spread_rate
    things[:, SPREAD_MAX] = most
    return things


def some_move(things: Array) -> bool:
    """Whether any of things (M, 7) has a velocity."""
    # a third of the time of `any`
    return bool(np.count_nonzero(things[:, VELOCITY]))


def some_spread(things: Array) -> bool:
    """Whether any of things (M, 7) grows: its velocity was seen, not given."""
    return bool(np.count_nonzero(things[:, SPREAD_RATE]))


def later(things: Array, time: float) -> Array:
    """Things (M, 7) as they are a time from now [s]; the very same array where all stand."""
    if not (some_move(things) or some_spread(things)):
        return things
    after = things.copy()
    after[:, PLACE] += time * things[:, VELOCITY]
    grown = np.minimum(time * things[:, SPREAD_RATE], things[:, SPREAD_MAX])
    after[:, RADIUS] += grown
    after[:, SPREAD_MAX] -= grown
    return after


def distances(things: Array, points: Array, times: Array) -> Array:
    """Distances of points at times from the edges of all things, negative inside, (n, M) [m].

    Parameters
    ----------
    things : ndarray
        (M, 7).
    points, times : ndarray
        (n, 2) [m] and (n,) [s], from now.
    """
    x = points[:, :1] - things[:, 0]
    y = points[:, 1:] - things[:, 1]
    if some_move(things):
        x -= times[:, None] * things[:, 3]
        y -= times[:, None] * things[:, 4]
    found = np.hypot(x, y, out=x)
    found -= things[:, RADIUS]
    return _less_growth(found, things, times)


def distances_and_directions(things: Array, points: Array, times: Array) -> tuple[Array, Array]:
    """Distances (n, M) as of `distances`, and the directions away from each thing, (n, M, 2).

    At a centre the direction is arbitrary.
    """
    away = points[:, None, :] - things[:, PLACE]
    if some_move(things):
        away -= times[:, None, None] * things[:, VELOCITY]
    length = np.hypot(away[..., 0], away[..., 1])
    if np.minimum.reduce(length, axis=None, initial=1.0) < AT_CENTRE:
        at_centre = length < AT_CENTRE
        away[at_centre] = (AT_CENTRE, 0.0)
        length[at_centre] = AT_CENTRE
    away /= length[..., None]
    length -= things[:, RADIUS]
    return _less_growth(length, things, times), away


def _less_growth(found: Array, things: Array, times: Array) -> Array:
    """Take off distances (n, M) by what things have grown at times (n,)."""
    if some_spread(things):
        found -= np.minimum(times[:, None] * things[:, SPREAD_RATE], things[:, SPREAD_MAX])
    return found


def clearance(things: Array, points: Array, times: Array) -> tuple[Array, Array, Array]:
    """Distance from the nearest thing, the direction away from it, and which one it is.

    Parameters
    ----------
    things, points, times : ndarray
        As of `distances`.

    Returns
    -------
    distance, direction, row : ndarray
        (n,) [m], (n, 2) and (n,); infinite, zero and -1 where there is nothing.
    """
    if not len(things):
        return np.full(len(points), np.inf), np.zeros((len(points), 2)), np.full(len(points), -1)
    found, away = distances_and_directions(things, points, times)
    row = found.argmin(axis=1)
    each = np.arange(len(points))
    return found[each, row], away[each, row], row


def nearest(things: Array, points: Array, times: Array, k: int) -> tuple[Array, Array, Array]:
    """The k nearest things of each point, in the order of the table; all where they are fewer.

    Parameters
    ----------
    things, points, times : ndarray
        As of `distances`.
    k : int
        At least 1.

    Returns
    -------
    distance, direction, row : ndarray
        (n, k) [m], (n, k, 2) and (n, k).
    """
    found, away = distances_and_directions(things, points, times)
    if len(things) <= k:
        return found, away, np.tile(np.arange(len(things)), (len(points), 1))
    row = np.argpartition(found, k - 1, axis=1)[:, :k]
    # so that a row keeps its thing from pass to pass
    row.sort(axis=1)
    each = np.arange(len(points))[:, None]
    return found[each, row], away[each, row], row
