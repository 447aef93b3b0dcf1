"""What the beams of a scan show of the cells of a map.

Sizes: a map of H by W cells, at most 400 by 400.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

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
