"""The kernels in C for scans and circles that are followed; see `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kmpc_lite.control.kernels._kernels as c
from kmpc_lite.types import Array


def dense(array: Array) -> Array:
    """Array as the kernels take it: float64, row by row."""
    out: Array = np.ascontiguousarray(array, dtype=np.float64)
    return out


def clusters(
    reach: Array,
    ends: Array,
    hits: NDArray[np.bool_],
    clear: NDArray[np.bool_],
    mount: Array,
    step: float,
    gap: float,
    largest: float,
) -> Array:
    """As `clusters.clusters`."""
    beams = len(reach)
    out, count = np.empty((beams // 3 + 1, 3)), np.empty(1, dtype=np.intc)
    own = dense(reach), dense(ends), hits, clear, dense(mount)
    c.clusters(*own, np.empty(beams, dtype=np.intc), out, count, step, gap, largest)
    return out[: count[0]]


def follow(
    tracks: Array, circles: Array, sources: Array, *numbers: float
) -> tuple[Array, NDArray[np.intc]]:
    """As `tracks.follow`."""
    rows, columns = len(tracks), len(circles)
    after, found = np.array(tracks, dtype=np.float64), np.empty(columns, dtype=np.intc)
    room = np.empty(rows * columns + 3 * rows + 2 * columns)
    indices = np.empty(4 * rows + 3 * columns, dtype=np.intc)
    c.follow(dense(circles), dense(sources), after, found, room, indices, *numbers)
    return after, found
