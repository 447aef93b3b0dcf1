"""A map that nobody drew: room around a start, goals and obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

ROOM = 1.0
"""Between the edge of such a map and what is on it [m]."""
LEAST_HALF = 2.0
"""It reaches at least so far from its origin [m]."""
LEAST_TIMEOUT, SECONDS_A_METRE = 20.0, 5.0
"""Each goal may take so long [s], and so long for each metre of the whole way [s/m]."""


def drawn_table(
    goals: Sequence[Sequence[float]],
    start: Sequence[float] = (0.0, 0.0, 0.0),
    obstacles: Sequence[Sequence[float]] = (),
) -> dict[str, Any]:
    """Table of a scenario with room around start, goals and circles, as a file would hold it."""
    places = [list(row[:2]) for row in (start, *goals, *obstacles)]
    low = [min(-LEAST_HALF, min(place[axis] for place in places) - ROOM) for axis in (0, 1)]
    high = [max(LEAST_HALF, max(place[axis] for place in places) + ROOM) for axis in (0, 1)]
    distance = sum(math.dist(a[:2], b[:2]) for a, b in pairwise((start, *goals)))
    return {
        "map": {"bounds": [*low, *high], "circles": [list(row) for row in obstacles]},
        "robot": {"start": list(start), **goals_table(goals)},
        "run": {"timeout": max(LEAST_TIMEOUT, SECONDS_A_METRE * distance)},
    }


def goals_table(goals: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Keys of [robot] for goals one after the other: the last one is the scenario's goal."""
    *via, goal = (list(row) for row in goals)
    return {"via": via, "goal": goal}
