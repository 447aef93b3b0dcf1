"""Where a path that was found on a lattice bends, and where lines cut solids."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.lattice import Lattice

BACK_OFF = 0.001
"""Start or goal may lie nearer to an obstacle than the path's clearance. The path may then come
nearer than they do by this much [m]."""
LATTICE_CUT = 0.02
"""How deep a path may cut the inflated cells of a grid [m]: its clearance is larger than what the
robot needs."""
LATTICE_LOOK = 80
"""A lattice path is pulled straight: from each corner, the farthest node in sight is looked for
among so many."""
LATTICE_SAMPLE = 0.04
"""A line is looked at in points that lie so far apart [m]."""


class LatticePath:
    """Where a path between the obstacles of a large grid bends.

    Parameters
    ----------
    lattice : Lattice
        That it was found on.
    points : ndarray
        (n, 2) from start to goal [m].
    inflation : float
        Distance from the solids [m].
    ends : float
        Distance of start or goal from the solids, whichever is nearer [m].
    """

    def __init__(self, lattice: Lattice, points: Array, inflation: float, ends: float) -> None:
        self._lattice = lattice
        bends = [0]
        while bends[-1] < len(points) - 1:
            ahead = np.arange(bends[-1] + 1, min(bends[-1] + LATTICE_LOOK, len(points)))
            here = np.repeat(points[bends[-1] : bends[-1] + 1], len(ahead), axis=0)
            seen = lattice.lines_free(here, points[ahead], inflation)
            bends.append(int(ahead[np.flatnonzero(seen)[-1]] if seen.any() else ahead[0]))
        self.points = points[bends]
        """(K, 2) [m]."""
        self.radius = max(min(inflation, ends - BACK_OFF), 0.0)
        """Distance that the path keeps from solids [m]: `inflation`, where start and goal do."""
        between = self.points[1:-1]
        self.corners = lattice.touched(between)[1] if len(between) else np.empty((0, 2))
        """(C, 2) points on the edges of solids that the path goes around [m]."""

    def lines_free(self, first: Array, last: Array) -> Array:
        """Which lines from (T, 2) to (T, 2) cut no solid, (T,)."""
        return self._lattice.lines_free(first, last, self.radius)

    def cut(self, points: Array) -> Array:
        """Where a line through points (K, 2) comes too near to solids.

        The points (C, 2) lie on the edges of the solids, one for each time [m].
        """
        lengths = np.hypot(*np.diff(points, axis=0).T)
        along = np.append(0.0, np.cumsum(lengths))
        places = np.arange(0.0, along[-1], LATTICE_SAMPLE)
        dense = np.column_stack([np.interp(places, along, points[:, i]) for i in (0, 1)])
        # the lattice tells where to look
        near = self._lattice.distances(dense) < self.radius + LATTICE_SAMPLE
        close = np.flatnonzero(near)
        if not len(close):
            return np.empty((0, 2))
        distance, edge = self._lattice.touched(dense[close])
        inside = distance < self.radius - LATTICE_CUT
        ends = np.flatnonzero((np.diff(close) > 1) | np.diff(inside)) + 1
        pieces = np.split(np.arange(len(close)), ends)
        deepest = [piece[np.argmin(distance[piece])] for piece in pieces if inside[piece[0]]]
        return edge[deepest]
