"""A map as the path searches see it: corners to go around, or a lattice where they are many."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.options import GuidanceOptions

# here, for no step has time to import its image filters
from kmpc_lite.control.path.lattice import Lattice
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids


class PathMap:
    """Polygons, walls and grids, prepared for the searches.

    Parameters
    ----------
    solids : Solids
        At rest.
    options : GuidanceOptions
        In metres.
    coarseness : float
        How far the solids may stand out of what they were made of: they are cells [m].
    later : bool
        Whether the lattice is made part by part, by `prepare`, and a path on it found so, too.
    limits : tuple of ndarray, optional
        Corners (2,), (2,) of the area that paths lie in [m].
    """

    def __init__(
        self,
        solids: Solids,
        options: GuidanceOptions,
        coarseness: float = 0.0,
        later: bool = False,
        limits: tuple[Array, Array] | None = None,
    ) -> None:
        self._limits = limits
        self.solids, self._options = solids, options
        self.coarseness = coarseness
        """How far the solids may stand out of what they were made of [m]."""
        self.later = later
        """Whether work on the lattice is done part by part."""
        self.lattice: Lattice | None = None
        """Where the grids have too many corners."""
        many = solids.rectangle_count > options.lattice_rectangles
        self.corners = solids.outline_corners if many else solids.all_corners
        """What paths go around: all corners, but for those of grids with a lattice."""
        self.landmarks = self.corners.middles
        """(L, 2) a point in each obstacle [m]: paths differ by the sides on which they pass."""
        self.is_ready = not many
        """Whether a search may begin."""
        if many and not later:
            self._make_lattice(limits)

    def prepare(self, start: Array, goal: Array) -> None:
        """Do what is left before a search from a start to a goal may begin."""
        limits = self._limits
        if limits is not None:
            # only start and goal may lie outside
            low, high = np.minimum(start[:2], goal[:2]), np.maximum(start[:2], goal[:2])
            limits = np.minimum(limits[0], low), np.maximum(limits[1], high)
        self._make_lattice(limits)

    def _make_lattice(self, limits: tuple[Array, Array] | None) -> None:
        self.lattice = Lattice(self.solids, self._options, limits)
        self.landmarks = np.concatenate([self.corners.middles, self.lattice.landmarks])
        self.is_ready = True


@lru_cache(maxsize=16)
def coarser(options: GuidanceOptions, nodes: int, step: float) -> GuidanceOptions:
    """Options whose lattice has so many nodes at the most, so far from each other at least [m]."""
    return replace(options, lattice_nodes=nodes, lattice_step=step)


def same_solids(first: Solids | None, second: Solids | None) -> bool:
    """Whether two maps are one."""
    if first is second:
        return True
    return first is not None and second is not None and first.solids == second.solids
