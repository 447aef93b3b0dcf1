"""What the beams of a scan show of the cells of a map.

Sizes: a map of H by W cells, at most 400 by 400.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.types import Array

DIRECTIONS = 2048
"""Directions that are told apart all around: the beams of the finest scanner that is usual."""
NOTHING = 1e-15
"""Keeps a quotient finite: what it is added to changes by less than rounding."""

Bits = NDArray[np.bool_]
Cells = NDArray[np.int8]
Singles = NDArray[np.float32]
Window = tuple[int, int, int, int]
"""First row and the one behind the last, the same of columns."""


def numbers_of(x: Singles, y: Singles) -> NDArray[np.intp]:
    """Number directions (x, y) from 0, straight back, counter-clockwise.

    Without an arc tangent: by the sum of both sides of a triangle. Straight back has the number
    DIRECTIONS, too.
    """
    size: Singles = np.abs(x)
    size += np.abs(y)
    size += NOTHING
    turn = np.divide(x, size, out=size)
    turn *= -0.25 * DIRECTIONS
    turn += 0.25 * DIRECTIONS
    np.copysign(turn, y, out=turn)
    turn += 0.5 * DIRECTIONS
    return turn.astype(np.intp)


def window_between(
    low: tuple[float, float],
    high: tuple[float, float],
    place: tuple[float, int, int],
    shape: tuple[int, int],
) -> Window:
    """Rows and columns of the cells between two corners, of a map of so many rows and columns."""
    (left, bottom), (right, top), (height, width) = low, high, shape
    cell, column, row = place
    bottom, left = math.floor(bottom / cell) - row, math.floor(left / cell) - column
    top, right = math.floor(top / cell) - row + 1, math.floor(right / cell) - column + 1
    rows = min(max(bottom, 0), height), min(max(top, 0), height)
    return *rows, min(max(left, 0), width), min(max(right, 0), width)


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

    Parameters
    ----------
    state, seen, extent, place, origin, turn, squares, clock
        As of `see_through`.
    low, high : tuple of float
        Corners of the area that no ray has left [m].
    distance : float
        From the origin, along each axis, up to which all cells are looked at [m].
    farther : bool
        Whether those farther away are looked at.
    """
    (x, y), shape = origin, (state.shape[0], state.shape[1])
    near_low = max(low[0], x - distance), max(low[1], y - distance)
    near_high = min(high[0], x + distance), min(high[1], y + distance)
    near = window_between(near_low, near_high, place, shape)
    see_through(state, seen, extent, near, place, origin, turn, squares, clock, False)
    if not farther:
        return
    (top, bottom, left, right), far = near, window_between(low, high, place, shape)
    sides: list[Window] = [far]
    if top < bottom and left < right:
        first, last, begin, end = far
        sides = [(first, top, begin, end), (bottom, last, begin, end)]
        sides += [(top, bottom, begin, left), (top, bottom, right, end)]
    for side in sides:
        see_through(state, seen, extent, side, place, origin, turn, squares, clock, True)


def see_through(
    state: Cells,
    seen: Singles,
    extent: Singles,
    window: Window,
    place: tuple[float, int, int],
    origin: tuple[float, float],
    turn: tuple[float, float],
    squares: Singles,
    clock: float,
    only_hit: bool,
) -> None:
    """Take note of the cells that rays passed through: through their middles.

    What was occupied has one pass less; what was unknown is free.

    Parameters
    ----------
    state : ndarray
        (H, W) below 0: unknown; 0: free; n: occupied until n more scans have passed. Changed.
    seen : ndarray
        (H, W) when each was seen last; changed.
    extent : ndarray
        (H, W, 4) box around what was hit in each cell, from its lower corner [m].
    window : Window
        That is looked at.
    place : tuple
        Side of a cell [m]; number of the first column and of the first row in the world.
    origin : tuple of float
        Where the rays begin [m].
    turn : tuple of float
        Cosine and sine of the heading of the frame in which directions are numbered.
    squares : ndarray
        (2049,) square of how far rays passed in each direction [m^2].
    clock : float
        Now.
    only_hit : bool
        Whether only what is occupied is looked at, and must be passed where it was hit.
    """
    top, bottom, left, right = window
    cell, first_column, first_row = place
    if only_hit:
        rows, columns = np.nonzero(state[top:bottom, left:right] > 0)
        rows, columns = rows + top, columns + left
        box = extent[rows, columns].astype(np.float64)
        low_x, low_y = (columns + first_column) * cell, (rows + first_row) * cell
        hit_x = 0.5 * ((low_x + box[:, 0]) + (low_x + box[:, 2]))
        hit_y = 0.5 * ((low_y + box[:, 1]) + (low_y + box[:, 3]))
        gone = _passed(hit_x, hit_y, origin, turn, squares)
        state[rows[gone], columns[gone]] -= 1
        return
    part, times = state[top:bottom, left:right], seen[top:bottom, left:right]
    x = cell * (first_column + 0.5 + np.arange(left, right))
    y = cell * (first_row + 0.5 + np.arange(top, bottom))
    passed = _passed(x[None], y[:, None], origin, turn, squares)
    np.copyto(part, np.maximum(part - 1, 0), where=passed)
    np.maximum(times, passed * np.float32(clock), out=times)


def _passed(
    x: Array,
    y: Array,
    origin: tuple[float, float],
    turn: tuple[float, float],
    squares: Singles,
) -> Bits:
    """Whether rays passed through points at x and y."""
    # single precision is a micrometre here, and half the time
    right: Singles = (x - origin[0]).astype(np.float32)
    up: Singles = (y - origin[1]).astype(np.float32)
    cos, sin = np.float32(turn[0]), np.float32(turn[1])
    ahead, aside = cos * right + sin * up, cos * up - sin * right
    reached = squares.take(numbers_of(ahead, aside), mode="clip")
    found: Bits = reached >= right * right + up * up
    return found


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

    Parameters
    ----------
    state, seen, extent, place
        As of `see_through`; changed.
    taken : ndarray
        (H, W) when each was hit that was free until then; changed.
    points, errors : ndarray
        (n, 2) and (n,) [m].
    level : int
        State of cells that are occupied.
    clock : float
        Now.
    """
    cell, first_column, first_row = place
    height, width = state.shape
    whole = np.floor(points / cell)
    column, row = whole[:, 0] - first_column, whole[:, 1] - first_row
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    cells = (row[inside] * width + column[inside]).astype(np.intp)
    if not len(cells):
        return
    order = np.argsort(cells, kind="stable")
    cells, off = cells[order], errors[inside][order, None]
    places = (points[inside] - cell * whole[inside])[order]
    begins = np.flatnonzero(np.diff(cells, prepend=-1))
    cells = cells.take(begins)
    flat = state.ravel()
    taken.ravel()[cells[flat[cells] == 0]] = clock
    flat[cells] = level
    seen.ravel()[cells] = clock
    boxes = extent.reshape(-1, 4)
    boxes[cells, :2] = np.minimum.reduceat(places - off, begins)
    boxes[cells, 2:] = np.maximum.reduceat(places + off, begins)


def hit_boxes(
    state: Cells, extent: Singles, window: tuple[int, int, int, int], place: tuple[float, int, int]
) -> tuple[Array, Array]:
    """Corners (n, 2), (n, 2) of what was hit in the occupied cells of a window, row by row.

    Parameters
    ----------
    state, extent, window, place
        As of `see_through`.
    """
    top, bottom, left, right = window
    rows, columns = np.nonzero(state[top:bottom, left:right] > 0)
    rows, columns = rows + top, columns + left
    cell, first_column, first_row = place
    corner = np.stack([(columns + first_column) * cell, (rows + first_row) * cell], axis=1)
    box = extent[rows, columns].astype(np.float64)
    return corner + box[:, :2], corner + box[:, 2:]


def rectangles(cells: Bits) -> NDArray[np.intc]:
    """Rectangles (B, 4) of cells (H, W): first column and row, and one past the last of each.

    Each is a run of cells in a row, joined with equal runs of the rows that follow; they come in
    the order of their first columns, then of their last ones, then of their rows.
    """
    height, width = cells.shape
    padded = np.zeros((height, width + 2), dtype=np.int8)
    padded[:, 1:-1] = cells
    # no run goes on from one row to the next: all rows are looked at as one
    change = np.diff(padded.ravel())
    rows, begins = np.divmod(np.flatnonzero(change == 1), width + 2)
    ends = np.flatnonzero(change == -1) - (width + 2) * rows
    # in one number: runs of equal columns stand one after the other, and a rectangle goes on while
    # the rows do
    runs = (begins * (width + 1) + ends) * (height + 1) + rows
    runs.sort()
    goes_on = runs[1:] == runs[:-1] + 1
    first = np.flatnonzero(np.concatenate([[True], ~goes_on])[: len(runs)])
    last = np.append(first[1:], len(runs)) - 1 if len(first) else first
    columns, bottom = np.divmod(runs[first], height + 1)
    left, right = np.divmod(columns, width + 1)
    found = np.stack([left, bottom, right, runs[last] % (height + 1) + 1], axis=1)
    return found.astype(np.intc)
