"""What a scan's beams measure together: neighbours on one surface are averaged.

Sizes: B beams, at most 16,384.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from kmpc_lite.types import Array

NEIGHBOURS = 8
"""Most neighbours on each side that a range is averaged with."""
SAME_SURFACE = 3.0
"""Ranges that differ by more standard deviations are of two surfaces."""
INDEPENDENT = 2
"""Most beams whose errors count as independent: a scanner errs alike in neighbouring ones, and what
is averaged over an edge lies behind it."""


def averaged_ranges(
    ranges: Array, hits: NDArray[np.bool_], step: float, noise: float, half: float
) -> tuple[Array, Array]:
    """Average each range with its neighbours on the same surface.

    A surface is known better than one beam tells: the outermost of many noisy hits would lie
    farther out than the surface, the more so the more beams meet it.

    Parameters
    ----------
    ranges : ndarray
        (B,) [m].
    hits : ndarray
        (B,) which beams hit something.
    step : float
        Angle from beam to beam [rad].
    noise : float
        Standard deviation of a range [m].
    half : float
        How far along a surface neighbours lie at the most [m].

    Returns
    -------
    averaged : ndarray
        (B,) ranges, those of other beams as they were [m].
    deviations : ndarray
        (B,) standard deviations of these, as far as they are sure [m].
    """
    known = np.pad(np.where(hits, ranges, np.inf).astype(np.float32), NEIGHBOURS, "edge")
    known[:NEIGHBOURS] = known[-NEIGHBOURS:] = np.inf
    others = sliding_window_view(known, 2 * NEIGHBOURS + 1)
    own = np.where(hits, ranges, 0.0).astype(np.float32)
    away = others - own[:, None]
    beams = np.abs(np.arange(-NEIGHBOURS, NEIGHBOURS + 1, dtype=np.float32))
    same = np.abs(away) <= np.float32(SAME_SURFACE * noise)
    same &= beams * np.float32(step) * own[:, None] <= np.float32(half)
    away[~same] = 0.0
    counts = np.maximum(np.count_nonzero(same, axis=1), 1)
    deviations = noise / np.sqrt(np.minimum(counts, INDEPENDENT))
    return ranges + away.sum(axis=1) / counts, deviations
