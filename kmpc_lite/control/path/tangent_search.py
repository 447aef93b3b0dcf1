"""All paths on tangent graphs, the quickest first, found part by part.

Only circles that the quickest path would cut without them, and the walls of circles that overlap
with these, make it into the graph, so that far ones cost next to nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np

from kmpc_lite.control.path.cuts import cut_obstacles, with_corners, with_walls
from kmpc_lite.control.path.tangent_graph import CUT_DEPTH, GeometricPath, PathQuery, TangentGraph
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

CORNER_ROUNDS = 12
"""A path may still cut corners that the graph does not hold. They are added, and the graph is
searched again, so often; after that the lattice's own path is taken."""
GRAPH_CIRCLES = 150
"""Most circles and corners of one graph: where more are in the way, the search gives up."""

NO_POINTS = np.empty((0, 2))


def tangent_paths(
    query: PathQuery, takes: Callable[[GeometricPath], bool]
) -> Generator[int, None, bool]:
    """Offer paths from a pose to a pose: one for each first tangent and gear, the quickest first.

    The first path is the quickest of all around all circles, the later ones are a choice. With a
    path on a lattice, also around its corners, and the lattice's own, with turns on the spot.

    Parameters
    ----------
    query : PathQuery
        Between what, and around what.
    takes : callable
        Is given each path; tells whether no later one is wanted.

    Yields
    ------
    int
        How many quanta the next part of the work takes.

    Returns
    -------
    bool
        Whether more is in the way than a graph takes.
    """
    lattice_path, rounds = query.lattice_path, 0
    own, *other = [None] if lattice_path is None else _straight(query)
    touched = NO_POINTS if lattice_path is None else lattice_path.corners
    straight = np.stack([query.start[:2], query.goal[:2]])
    known = with_corners(_cut(query, straight), query.edges)
    while rounds <= CORNER_ROUNDS:
        if np.count_nonzero(known) + len(touched) > GRAPH_CIRCLES:
            # what is left is the lattice's own path, if there is one
            return own is None or not any(map(takes, (own, *other)))
        graph = _graph(query, known, touched)
        yield from graph.build()
        found = False
        while graph.next_candidate():
            if own is not None and own.time < graph.time:
                if takes(own):
                    return False
                own = None
            yield 1
            path = graph.trace()
            cut = _cut(query, path.points)
            deep = NO_POINTS if lattice_path is None else lattice_path.cut(path.points)
            if not cut.any() and not len(deep):
                found = True
                if takes(path):
                    return False
            elif not found and (len(deep) or not known[cut].all()):
                break  # it cuts what was not known
        else:
            break
        if lattice_path is not None:
            touched = np.concatenate([touched, deep])
            rounds += 1
        known = with_walls(known | cut, query.centres, query.radii, query.edges)
    any(map(takes, other if own is None else (own, *other)))
    return False


def _graph(query: PathQuery, known: Array, touched: Array) -> TangentGraph:
    """Graph of the circles (M,) that are known to be in the way, and of corners (C, 2)."""
    edges = (np.cumsum(known) - 1)[query.edges[known[query.edges[:, 0]]]]
    centres, radii = query.centres[known], query.radii[known]
    if query.lattice_path is not None:
        centres = np.concatenate([centres, touched])
        radii = np.concatenate([radii, np.full(len(touched), query.lattice_path.radius)])
    return TangentGraph(query, centres, radii, edges)


def _cut(query: PathQuery, points: Array) -> Array:
    """Which circles (M,) a line through points (K, 2) cuts."""
    return cut_obstacles(points, query.centres, query.radii, query.edges, CUT_DEPTH)


def _straight(query: PathQuery) -> list[GeometricPath]:
    """The lattice's path, straight from corner to corner, with turns on the spot.

    In the quicker gear; and in the other one where a robot may fit into one alone.
    """
    assert query.lattice_path is not None
    points, (speed, turn_rate) = query.lattice_path.points, query.speed
    steps = np.diff(points, axis=0)
    directions = np.arctan2(steps[:, 1], steps[:, 0])
    driving = float(np.hypot(steps[:, 0], steps[:, 1]).sum()) / speed
    paths = []
    gears = (0.0, 1.0), (np.pi, query.backward_share)
    for (gear, share), look_time in zip(gears, query.look_times, strict=True):
        if share <= 0.0:
            continue
        start, goal = query.start[2] - gear, query.goal[2] - gear
        turns = wrap(np.diff(directions, prepend=start))
        headings = start + np.cumsum(turns)
        turned = np.abs(turns).sum() + abs(wrap(goal - headings[-1]))
        time = (driving + turned / turn_rate) / share + look_time
        paths.append(
            GeometricPath(
                np.stack([points[:-1], points[1:]], axis=1).reshape(-1, 2),
                np.repeat(headings, 2),
                float(time),
                gear > 0.0,
            )
        )
    paths.sort(key=lambda path: path.time)
    return paths if query.either_gear else paths[:1]
