"""The obstacles of a step, sorted: circles as rows of an array, solids prepared once for as long as they stay the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.obstacles.circles import Circle, circles_to_array
from kmpc_lite.control.obstacles.occupancy import OccupancyGrid
from kmpc_lite.control.obstacles.shapes import Polygon, Wall
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Solids

SOLID = (Polygon, Wall, OccupancyGrid)
Solid = Polygon | Wall | OccupancyGrid
Obstacle = Circle | Solid
Obstacles = Sequence[Obstacle] | ArrayLike


class Scene:
    """Sorts obstacles, and remembers the solids that it prepared last."""

    def __init__(self) -> None:
        self._known: Solids | None = None

    def sort(self, obstacles: Obstacles) -> tuple[Array, Solids | None]:
        """Circles (M, 5), and solids if there are any.

        Raises
        ------
        ValueError
            For what is neither circles, nor solids, nor an array of circles.
        """
        if isinstance(obstacles, np.ndarray) or not isinstance(obstacles, Sequence):
            return circles_to_array(cast(ArrayLike, obstacles)), None
        solids = [o for o in obstacles if isinstance(o, SOLID)]
        if not solids:
            return circles_to_array(cast(ArrayLike, obstacles)), None
        circles = circles_to_array([o for o in obstacles if not isinstance(o, SOLID)])
        # sequences compare their items by identity first, which for the same ones is all that it
        # takes
        if self._known is None or self._known.solids != tuple(solids):
            # here, since most maps have none
            from kmpc_lite.control.obstacles.solids import Solids

            self._known = Solids(solids)
        return circles, self._known
