"""All that a search on tangent graphs or on a lattice finds, its parts one after the other."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import TypeVar

import numpy as np

from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import tangent_paths

Result = TypeVar("Result")
NO_EDGES = np.empty((0, 2), dtype=np.intp)


def quickest_paths(
    centres: np.ndarray,
    radii: np.ndarray,
    start: np.ndarray,
    goal: np.ndarray,
    area: np.ndarray,
    speed: np.ndarray,
    backward: float = 1.0,
    edges: np.ndarray = NO_EDGES,
) -> Iterator[GeometricPath]:
    """Paths from a pose to a pose, the quickest first; none if the circles leave none."""
    query = PathQuery(start, goal, centres, radii, edges, area, speed, backward)
    return iter(all_paths(query))


def all_paths(query: PathQuery) -> list[GeometricPath]:
    """Every path that a search offers."""
    found: list[GeometricPath] = []

    def takes(path: GeometricPath) -> bool:
        found.append(path)
        return False

    ended(tangent_paths(query, takes))
    return found


def ended(work: Generator[int, None, Result]) -> Result:
    """What comes of a work that is done part by part."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value
