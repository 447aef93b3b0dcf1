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

    `things`: (M, 7). `points`, `times`: (n, 2) [m] and (n,) [s], from now.
    """
    x = points[:, :1] - things[:, 0]
    y = points[:, 1:] - things[:, 1]
    if some_move(things):
        x -= times[:, None] * things[:, 3]
        y -= times[:, None] * things[:, 4]
    found: Array = np.hypot(x, y, out=x)
    found -= things[:, RADIUS]
    if some_spread(things):
        found -= np.minimum(times[:, None] * things[:, SPREAD_RATE], things[:, SPREAD_MAX])
    return found
