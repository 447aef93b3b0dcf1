"""What a drive is asked for on a command line, instead of what its scenario says, or without one.

A map is then drawn without bounds: a start, goals and obstacles, and the room around them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from kmpc_lite.errors import ProblemError, ScenarioError
from kmpc_lite.reading import parse_toml

NO_AREA = (-math.inf, -math.inf, math.inf, math.inf)  # bounds of a robot that may go everywhere
ROOM = 1.0  # between the edge of the pictures and what is on them [m]
LEAST_HALF = 2.0  # they reach at least so far from the origin [m]
LEAST_TIMEOUT, SECONDS_A_METRE = 20.0, 5.0
"""Time for each goal on such a map [s], and for each metre of the whole way [s/m], if that is more.
"""
WEIGHTS = "weights"  # section of a scenario


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


class DriveOverrides(NamedTuple):
    """What counts instead of a scenario's own."""

    goals: Sequence[tuple[float, float, float]] = ()
    """One after the other; without a scenario, on an empty map."""
    loop: bool = False  # whether the first goal follows the last one, until time is up
    clearance: float | None = None  # to keep from obstacles beyond the radii [m]
    radius: float | None = None  # of the robot [m]
    options: Sequence[str] = ()
    """Options of the controller: ``group.option=value``; ``weights.R_change=[0.1, 0.1]``."""

    def put(self, table: dict[str, Any]) -> None:
        """Put them into the table of a scenario; raises ScenarioError for unknown options."""
        if self.goals:
            table["robot"].update(goals_table(self.goals))
        run = table.setdefault("run", {})
        if self.loop:
            run["loop"] = True
        if self.radius is not None:
            table["robot"]["radius"] = self.radius
        if self.clearance is not None:
            run["margin"] = self.clearance
        for item in self.options:
            (*groups, option), value = assignment(item)
            if groups == [WEIGHTS]:
                table.setdefault(WEIGHTS, {})[option] = value
                continue
            place = table.setdefault("controller", {})
            for group in groups:
                place = place.setdefault(group, {})
            place[option] = value
            check_options(item, table["controller"])


def assignment(item: str) -> tuple[list[str], Any]:
    """Parts of the name and TOML value of ``group.option=value``; raises ScenarioError."""
    name, equals, value = item.partition("=")
    parts = name.strip().split(".")
    expected = f"--set {item}: expected group.option=value: margins.headway=0.2"
    if not (equals and len(parts) > 1):
        raise ScenarioError(expected)
    try:
        return parts, parse_toml(f"value = {value}")["value"]
    except ValueError:
        raise ScenarioError(expected) from None


def check_options(item: str, tables: dict[str, Any]) -> None:
    """Raise ScenarioError, with the nearest names, for options that no controller has."""
    from kmpc_lite.control.options import ControllerOptions

    try:
        ControllerOptions.from_dict(tables)
    except ProblemError as error:
        raise ScenarioError(f"--set {item}: {error}") from error
