"""The solids that a robot can come to within a step, and their half-planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmpc_lite.control.world.boxes import GRID_COLUMNS, Boxes
from kmpc_lite.control.world.outlines import Outlines
from kmpc_lite.types import Array


class Nearby:
    """The solids that a robot can come to: what a step looks at."""

    def __init__(self, outlines: Outlines, boxes: Sequence[Boxes]) -> None:
        self._outlines, self._boxes = outlines, tuple(boxes)
        self._count = len(outlines)
        self.columns = self._count + sum(min(GRID_COLUMNS, len(b.low)) for b in self._boxes)
        """How many distances each point gets."""

    def __len__(self) -> int:
        return self.columns

    def with_boxes(self, boxes: Sequence[Boxes]) -> Nearby:
        """Return these and more rectangles."""
        return Nearby(self._outlines, [*self._boxes, *boxes])

    def measure(self, points: Array) -> tuple[Array, Array]:
        """Distances (n, C) and normals (n, C, 2) of the solids that matter at points (n, 2) [m]."""
        distance, normals = (
            self._outlines.distances(points)
            if self._count
            else (np.empty((len(points), 0)), np.empty((len(points), 0, 2)))
        )
        for boxes in self._boxes:
            _, gaps, away = boxes.choose(points)
            distance, normals = (
                np.concatenate([distance, gaps], axis=1),
                np.concatenate([normals, away], axis=1),
            )
        return distance, normals

    def least(self, points: Array) -> Array:
        """Distance (n,) of points (n, 2) from the nearest of these solids [m], negative inside."""
        least = np.full(len(points), np.inf)
        if self._count:
            least = self._outlines.distances(points)[0].min(axis=1)
        for boxes in self._boxes:
            least = np.minimum(least, boxes.distances(points).min(axis=1))
        return least
