"""The search for paths on tangent graphs, as data: it goes on part by part.

Only circles that the quickest path would cut without them, and the walls of circles that overlap
with these, make it into the graph, so that far ones cost next to nothing.
"""

from __future__ import annotations

from enum import Enum, auto

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


class Part(Enum):
    """The part of the work that comes next."""

    CIRCLES = auto()
    TANGENTS = auto()
    ARCS = auto()
    LINKS = auto()
    SOLUTION = auto()
    TRACE = auto()
    NEXT = auto()
    """A path was found, and the caller may want another one."""
    NOTHING = auto()
    """There are no more paths."""


class TangentSearch:
    """Finds paths from a pose to a pose: one for each first tangent and gear, the quickest first.

    The first path is the quickest of all around all circles, the later ones are a choice. With a
    path on a lattice, also around its corners; where these give no path, the lattice's own, with
    turns on the spot.

    Parameters
    ----------
    query : PathQuery
        Between what, and around what.
    """

    def __init__(self, query: PathQuery) -> None:
        self._query = query
        self._touched = NO_POINTS if query.lattice_path is None else query.lattice_path.corners
        self._rounds, self._found, self._some = 0, 0, False
        straight = np.stack([query.start[:2], query.goal[:2]])
        self._known = with_corners(self._cut(straight), query.edges)
        self._graph: TangentGraph | None = None
        self.part = Part.CIRCLES
        self.gave_up = False
        """Whether more is in the way than a graph takes."""

    def advance(self) -> GeometricPath | None:
        """Do one part of the work; the path that was found with it, if one was.

        Every part takes about as long. After a path the search goes on with the same part: its
        caller may call at once. `part` is NOTHING when there are no more paths.
        """
        graph = self._graph
        if self.part is Part.CIRCLES or graph is None:
            return self._begin_round()
        elif self.part is Part.TANGENTS:
            graph.add_tangents()
            self.part = Part.ARCS
        elif self.part is Part.ARCS:
            graph.add_arcs()
            self.part = Part.LINKS
        elif self.part is Part.LINKS:
            graph.link()
            self.part = Part.SOLUTION
        elif self.part is Part.SOLUTION:
            graph.solve()
            return self._next_candidate(graph)
        elif self.part is Part.TRACE:
            return self._judge(graph, graph.trace())
        elif self.part is Part.NEXT:
            return self._next_candidate(graph)
        return None

    @property
    def weight(self) -> int:
        """How many parts the next one counts as.

        Each tangent, of which there are as many as pairs of circles, is looked at beside each
        circle. A graph of a quarter of the circles that it takes at the most counts as one.
        """
        if self.part is not Part.TANGENTS or self._graph is None:
            return 1
        return max(round((4.0 * self._graph.size / GRAPH_CIRCLES) ** 3), 1)

    def _begin_round(self) -> GeometricPath | None:
        """Begin a graph of the circles that are known to be in the way.

        Where these are too many, what is left is the lattice's own path, if there is one.
        """
        query, known = self._query, self._known
        self._found = 0
        if np.count_nonzero(known) + len(self._touched) > GRAPH_CIRCLES:
            self.part, self.gave_up = Part.NOTHING, True
            return self._straight()
        edges = (np.cumsum(known) - 1)[query.edges[known[query.edges[:, 0]]]]
        centres, radii = query.centres[known], query.radii[known]
        if query.lattice_path is not None:
            centres = np.concatenate([centres, self._touched])
            size = np.full(len(self._touched), query.lattice_path.radius)
            radii = np.concatenate([radii, size])
        self._graph = TangentGraph(query, centres, radii, edges)
        self.part = Part.TANGENTS
        return None

    def _next_candidate(self, graph: TangentGraph) -> GeometricPath | None:
        """Go to the graph's next path; at its end, to what is left where it had none."""
        if graph.next_candidate():
            self.part = Part.TRACE
            return None
        self.part = Part.NOTHING
        nothing_met = not self._some and not self._known.any()
        return self._straight() if nothing_met else None

    def _judge(self, graph: TangentGraph, path: GeometricPath) -> GeometricPath | None:
        """Look whether a path of the graph cuts what was not known."""
        cut, lattice_path = self._cut(path.points), self._query.lattice_path
        deep = NO_POINTS if lattice_path is None else lattice_path.cut(path.points)
        if not cut.any() and not len(deep):
            self._found, self._some = self._found + 1, True
            self.part = Part.NEXT
            return path
        if self._found or (not len(deep) and self._known[cut].all()):
            return self._next_candidate(graph)
        if lattice_path is not None:
            self._touched = np.concatenate([self._touched, deep])
            self._rounds += 1
            if self._rounds > CORNER_ROUNDS:
                self.part = Part.NOTHING
                return self._straight()
        query = self._query
        self._known = with_walls(self._known | cut, query.centres, query.radii, query.edges)
        return self._begin_round()

    def _cut(self, points: Array) -> Array:
        """Which circles (M,) a line through points (K, 2) cuts."""
        query, depth = self._query, CUT_DEPTH
        return cut_obstacles(points, query.centres, query.radii, query.edges, depth)

    def _straight(self) -> GeometricPath | None:
        """The lattice's path, straight from corner to corner, with turns on the spot.

        Forwards or backwards, whichever is quicker.
        """
        query = self._query
        if query.lattice_path is None:
            return None
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
        return min(paths, key=lambda path: path.time)
