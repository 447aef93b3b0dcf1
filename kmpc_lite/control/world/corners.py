"""Corners of solids and the edges between them: what paths go around."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmpc_lite.control.world.boxes import Boxes
from kmpc_lite.control.world.outlines import Outlines
from kmpc_lite.types import Array


class Corners:
    """Corners of all solids, and the edges between them: what ways go around.

    Parameters
    ----------
    outlines : Outlines
        Of polygons and walls, numbered as below.
    corners : sequence of ndarray
        Corners (C, 2) of each polygon, wall and rectangle [m], in that order.
    boxes : sequence of Boxes
        The rectangles.
    """

    def __init__(
        self, outlines: Outlines, corners: Sequence[Array], boxes: Sequence[Boxes]
    ) -> None:
        self._outlines, self._boxes = outlines, boxes
        counts = np.array([len(c) for c in corners], dtype=np.intp)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        number = np.arange(int(counts.sum()))
        self.points = np.concatenate([np.empty((0, 2)), *corners])
        """(V, 2) [m]."""
        self.owner = np.repeat(np.arange(len(corners)), counts)
        """(V,) number of each corner's solid."""
        self.rounding = np.concatenate([outlines.rounding, np.zeros(len(corners) - len(outlines))])[
            self.owner
        ]
        """(V,) distance from a corner that belongs to the solid [m]."""
        following = first + (number - first + 1) % counts[self.owner]
        # a line has one edge, not one there and one back
        used = (counts[self.owner] > 2) | (number < following)
        self.edges = np.stack([number, following], axis=1)[used]
        """(S, 2) numbers of corners."""
        self.middles = np.array([c.mean(axis=0) for c in corners]).reshape(-1, 2)
        """(P, 2) a point within each solid [m]."""

    def to_centre(self, point: Array) -> Array:
        """Radius (V,) to which each corner can grow until its solid reaches a point (2,) [m].

        The edges of the solid grow with its corners.
        """
        here = point[None]
        gaps = [self._outlines.distances(here)[0][0]] if len(self._outlines) else []
        distance = np.concatenate(
            [np.empty(0), *gaps, *(b.distances(here)[0] for b in self._boxes)]
        )
        grown: Array = distance[self.owner] + self.rounding
        return grown
