"""What a map of scans shows, all of it at once."""

from __future__ import annotations

from kmpc_lite.control.kernels import library
from kmpc_lite.control.world.local_map import LocalMap
from kmpc_lite.types import Array


def hit_boxes(seen: LocalMap) -> tuple[Array, Array]:
    """Corners (n, 2), (n, 2) of what was hit in the occupied cells of a map."""
    height, width = seen.state.shape
    return library.hit_boxes(seen.state, seen.extent, (0, height, 0, width), seen.place)
