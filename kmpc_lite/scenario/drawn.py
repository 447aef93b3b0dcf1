"""A map without bounds: a start, goals and obstacles, and the room around them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

NO_AREA = (-math.inf, -math.inf, math.inf, math.inf)
"""Bounds of a robot that may go everywhere."""
ROOM = 1.0
"""Between the edge of the pictures and what is on them [m]."""
LEAST_HALF = 2.0
"""They reach at least so far from the origin [m]."""
LEAST_TIMEOUT, SECONDS_A_METRE = 20.0, 5.0
"""Time for each goal on such a map [s], and for each metre of the whole way [s/m], if that is more.
"""


def drawn_table(
    goals: Sequence[Sequence[float]],
    start: Sequence[float] = (0.0, 0.0, 0.0),
    obstacles: Sequence[Sequence[float]] = (),
) -> dict[str, Any]:
    """Table of a scenario with start, goals and circles, as a file would hold it."""
    distance = sum(math.dist(a[:2], b[:2]) for a, b in pairwise((start, *goals)))
    return {
        "map": {"circles": [list(row) for row in obstacles]},
        "robot": {"start": list(start), **goals_table(goals)},
        "run": {"timeout": max(LEAST_TIMEOUT, SECONDS_A_METRE * distance)},
    }


def area_around(values: Mapping[str, Any]) -> tuple[tuple[float, ...], bool]:
    """Give the bounds (4,) of a scenario's values without any, and whether they limit the robot.

    A grid does; without one they are what pictures show.
    """
    import numpy as np  # a help need not wait for it

    if (grid := values["grid"]) is not None:
        corners = np.array([[i, j] for i in (0, 1) for j in (0, 1)]) * grid.occupied.shape[::-1]
        x, y, theta = grid.origin
        turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
        placed = grid.resolution * corners @ turn + (x, y)
        return (*placed.min(axis=0).tolist(), *placed.max(axis=0).tolist()), True
    poses = (values["start"], *values["via"], values["goal"], *values["circles"])
    places = [pose[:2] for pose in poses]
    places += [corner for polygon in values["polygons"] for corner in polygon.vertices]
    places += [end for w in values["walls"] for end in ((w.x1, w.y1), (w.x2, w.y2))]
    low, high = np.min(places, axis=0) - ROOM, np.max(places, axis=0) + ROOM
    bounds = (*np.minimum(low, -LEAST_HALF).tolist(), *np.maximum(high, LEAST_HALF).tolist())
    return bounds, False


def goals_table(goals: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Keys of [robot] for goals one after the other: the last one is the scenario's goal."""
    *via, goal = (list(row) for row in goals)
    return {"via": via, "goal": goal}
