"""All paths of a tangent search, one after the other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import Part, TangentSearch

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
    """Paths from a pose to a pose, the quickest first; nothing if the circles leave none."""
    query = PathQuery(start, goal, centres, radii, edges, area, speed, backward)
    search = TangentSearch(query)
    while search.part is not Part.NOTHING:
        path = search.advance()
        if path is not None:
            yield path
