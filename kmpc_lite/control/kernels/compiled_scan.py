"""The kernels in C for scans and circles that are followed; see `compiled`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

import kmpc_lite.control.kernels._kernels as c
from kmpc_lite.control.kernels.scan_map import Bits, Cells, Singles
from kmpc_lite.types import Array

dense: Callable[[Array], Array] = partial(np.ascontiguousarray, dtype=np.float64)
"""Array as the kernels take it: float64, row by row."""


def clusters(
    reach: Array,
    ends: Array,
    hits: Bits,
    clear: Bits,
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


def told_beams(
    ranges: Array,
    along: Array,
    counts: Bits,
    mount: Array,
    least: float,
    most: float,
    own: float,
) -> tuple[Bits, Bits, Array, Array]:
    """As `scan_beams.told_beams`."""
    beams = len(ranges)
    kinds = np.empty(beams, dtype=bool), np.empty(beams, dtype=bool)
    lengths = np.empty(beams), np.empty((beams, 2))
    given = dense(ranges), dense(along), np.ascontiguousarray(counts), dense(mount)
    c.told_beams(*given, *kinds, *lengths, least, most, own)
    return *kinds, *lengths


def averaged_ranges(
    ranges: Array, hits: Bits, step: float, noise: float, half: float
) -> tuple[Array, Array]:
    """As `scan_beams.averaged_ranges`."""
    found = np.empty(len(ranges)), np.empty(len(ranges))
    c.averaged_ranges(dense(ranges), np.ascontiguousarray(hits), *found, step, noise, half)
    return found


def pass_rays(
    state: Cells,
    seen: Singles,
    extent: Singles,
    place: tuple[float, int, int],
    low: tuple[float, float],
    high: tuple[float, float],
    origin: tuple[float, float],
    turn: tuple[float, float],
    squares: Singles,
    distance: float,
    farther: bool,
    clock: float,
) -> None:
    """As `scan_map.pass_rays`."""
    where = state.shape[1], place, low, high, origin, turn
    c.pass_rays(state, seen, extent, squares, *where, distance, farther, clock)


def mark(
    state: Cells,
    seen: Singles,
    extent: Singles,
    taken: Singles,
    points: Array,
    errors: Array,
    place: tuple[float, int, int],
    level: int,
    clock: float,
) -> None:
    """As `scan_map.mark`."""
    cells, width = (state, seen, extent, taken), state.shape[1]
    c.mark(*cells, dense(points), dense(errors), width, place, level, clock)


def hit_boxes(
    state: Cells, extent: Singles, window: tuple[int, int, int, int], place: tuple[float, int, int]
) -> tuple[Array, Array]:
    """As `scan_map.hit_boxes`."""
    top, bottom, left, right = window
    most = max(bottom - top, 0) * max(right - left, 0)
    low, high, count = np.empty((most, 2)), np.empty((most, 2)), np.empty(1, dtype=np.intc)
    c.hit_boxes(state, extent, low, high, count, state.shape[1], window, place)
    return low[: count[0]].copy(), high[: count[0]].copy()


def rectangles(cells: Bits) -> NDArray[np.intc]:
    """As `scan_map.rectangles`."""
    height, width = cells.shape
    most, count = width // 2 + 1, np.empty(1, dtype=np.intc)
    found = np.empty((height * most, 4), dtype=np.intc)
    room = np.empty(2 * most, dtype=np.intc)
    c.rectangles(np.ascontiguousarray(cells), room, found, count, width)
    return found[: count[0]].copy()
