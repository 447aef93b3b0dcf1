"""The kernels in C for scans, and for circles that are followed.

Sizes: a map of H by W cells, at most 400 by 400.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import _kernels as c  # type: ignore[attr-defined]
from kmpc_lite.types import Array

Bits = NDArray[np.bool_]
Cells = NDArray[np.int8]
Singles = NDArray[np.float32]
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
    """Circles (K, 3) of what stands free: nothing nearer hides its left or its right side.

    Beams that tell nothing are left out. What is seen of a wall past a nearer thing moves with the
    robot, and is no cluster.

    `reach`: (B,) how far each beam saw nothing [m]. `ends`: (B, 2) where it ends in the robot's
    frame [m]. `hits`, `clear`: (B,) whether it hit something, and whether it saw that nothing is
    there. `mount`: (2,) the scanner in the robot's frame [m]. `step`: angle from beam to beam
    [rad]. `gap`: distance between neighbouring hits beyond which another cluster begins [m].
    `largest`: largest radius of a cluster [m]. Returns (K, 3) rows x, y, radius [m] in the robot's
    frame.
    """
    beams = len(reach)
    out, count = np.empty((beams // 3 + 1, 3)), np.empty(1, dtype=np.intc)
    own = dense(reach), dense(ends), hits, clear, dense(mount)
    c.clusters(*own, np.empty(beams, dtype=np.intc), out, count, step, gap, largest)
    return out[: count[0]]


def follow(
    tracks: Array, circles: Array, sources: Array, *numbers: float
) -> tuple[Array, NDArray[np.intc]]:
    """Bring tracks to the next period, with the circles that are seen then.

    Circles that are farther than the gate from where a track expects them may be its all the same
    if it turned round: then its velocity may be any of the same pace.

    `tracks`: (M, 39). `circles`, `sources`: (N, 5) and (N,) which sensor sees each: a track is that
    of one sensor. `dt`: period [s]. `memory`: how long turns last [s]. `acceleration`: standard
    deviation of accelerations along each axis [m/s^2]. `turning`: the same of turn rates [rad/s].
    `noise`: the same of a position along each axis [m]. `other`: the same of the change of velocity
    of what turned round [m/s]. `gate`, `chance`: squared Mahalanobis distances: of positions that
    are not a track's any more, and of velocities that differ from the given ones. Returns `after`:
    (M, 39); `found`: (N,) index of each circle's track; -1 for none.
    """
    rows, columns = len(tracks), len(circles)
    after, found = np.array(tracks, dtype=np.float64), np.empty(columns, dtype=np.intc)
    room = np.empty(rows * columns + 3 * rows + 2 * columns)
    indices = np.empty(4 * rows + 3 * columns, dtype=np.intc)
    c.follow(dense(circles), dense(sources), after, found, room, indices, *numbers)
    return after, found


def told_beams(
    ranges: Array, along: Array, counts: Bits, mount: Array, least: float, most: float, own: float
) -> tuple[Bits, Bits, Array, Array]:
    """Tell what each beam of a scan says.

    `ranges`: (B,) [m]. `along`: (B, 2) unit vectors of the beams in the robot's frame. `counts`:
    (B,) which beams count. `mount`: (2,) the scanner in the robot's frame [m]. `least`, `most`:
    ranges that are hits lie between these [m]; the latter itself and infinity say that nothing is
    there. `own`: hits no farther from the robot's centre are the robot itself [m]. Returns `hits`,
    `clear`: (B,) which beams hit something, and which saw that nothing is there; `reach`: (B,) how
    far each saw nothing; zero if it tells nothing [m]; `ends`: (B, 2) where it ends in the robot's
    frame [m].
    """
    beams = len(ranges)
    kinds = np.empty(beams, dtype=bool), np.empty(beams, dtype=bool)
    lengths = np.empty(beams), np.empty((beams, 2))
    given = dense(ranges), dense(along), np.ascontiguousarray(counts), dense(mount)
    c.told_beams(*given, *kinds, *lengths, least, most, own)
    return *kinds, *lengths


def averaged_ranges(
    ranges: Array, hits: Bits, step: float, noise: float, half: float
) -> tuple[Array, Array]:
    """Average each range with its neighbours on the same surface.

    A surface is known better than one beam tells: the outermost of many noisy hits would lie
    farther out than the surface, the more so the more beams meet it.

    `ranges`: (B,) [m]. `hits`: (B,) which beams hit something. `step`: angle from beam to beam
    [rad]. `noise`: standard deviation of a range [m]. `half`: how far along a surface neighbours
    lie at the most [m]. Returns `averaged`: (B,) ranges, those of other beams as they were [m];
    `deviations`: (B,) standard deviations of these, as far as they are sure [m].
    """
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
    """Take note of what rays passed through (`see_through`); farther away only of what was hit.

    `state`, `seen`, `extent`, `place`, `origin`, `turn`, `squares`, `clock`: as of `see_through`.
    `low`, `high`: corners of the area that no ray has left [m]. `distance`: from the origin, along
    each axis, up to which all cells are looked at [m]. `farther`: whether those farther away are
    looked at.
    """
    where = state.shape[1], *place, *low, *high, *origin, *turn
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
    """Mark the cells of hits (n, 2), which may be off by errors (n,), as occupied.

    `state`, `seen`, `extent`, `place`: as of `see_through`; changed. `taken`: (H, W) when each was
    hit that was free until then; changed. `points`, `errors`: (n, 2) and (n,) [m]. `level`: state
    of cells that are occupied. `clock`: now.
    """
    cells, width = (state, seen, extent, taken), state.shape[1]
    c.mark(*cells, dense(points), dense(errors), width, *place, level, clock)


def hit_boxes(
    state: Cells, extent: Singles, window: tuple[int, int, int, int], place: tuple[float, int, int]
) -> tuple[Array, Array]:
    """Corners (n, 2), (n, 2) of what was hit in the occupied cells of a window, row by row.

    `state`, `extent`, `window`, `place`: as of `see_through`.
    """
    top, bottom, left, right = window
    most = max(bottom - top, 0) * max(right - left, 0)
    low, high, count = np.empty((most, 2)), np.empty((most, 2)), np.empty(1, dtype=np.intc)
    c.hit_boxes(state, extent, low, high, count, state.shape[1], *place, *window)
    return low[: count[0]].copy(), high[: count[0]].copy()


def rectangles(cells: Bits) -> NDArray[np.intc]:
    """Rectangles (B, 4) of cells (H, W): first column and row, and one past the last of each.

    Each is a run of cells in a row, joined with equal runs of the rows that follow; they come in
    the order of their first columns, then of their last ones, then of their rows.
    """
    height, width = cells.shape
    most, count = width // 2 + 1, np.empty(1, dtype=np.intc)
    found = np.empty((height * most, 4), dtype=np.intc)
    room = np.empty(2 * most, dtype=np.intc)
    c.rectangles(np.ascontiguousarray(cells), room, found, count, width)
    return found[: count[0]].copy()
