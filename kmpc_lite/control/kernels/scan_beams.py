"""What a scan's beams tell, and measure together: neighbours on one surface are averaged.

Sizes: B beams, at most 16,384.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from kmpc_lite.control.kernels.scan_map import Bits
from kmpc_lite.types import Array

NEIGHBOURS = 8
"""Most neighbours on each side that a range is averaged with."""
SAME_SURFACE = 3.0
"""Ranges that differ by more standard deviations are of two surfaces."""
INDEPENDENT = 2
"""Most beams whose errors count as independent: a scanner errs alike in neighbouring ones, and what
is averaged over an edge lies behind it."""


def told_beams(
    ranges: Array,
    along: Array,
    counts: Bits,
    mount: Array,
    least: float,
    most: float,
    own: float,
) -> tuple[Bits, Bits, Array, Array]:
    """Tell what each beam of a scan says.

    Parameters
    ----------
    ranges : ndarray
        (B,) [m].
    along : ndarray
        (B, 2) unit vectors of the beams in the robot's frame.
    counts : ndarray
        (B,) which beams count.
    mount : ndarray
        (2,) the scanner in the robot's frame [m].
    least, most : float
        Ranges that are hits lie between these [m]; the latter itself and infinity say that nothing
        is there.
    own : float
        Hits no farther from the robot's centre are the robot itself [m].

    Returns
    -------
    hits, clear : ndarray
        (B,) which beams hit something, and which saw that nothing is there.
    reach : ndarray
        (B,) how far each saw nothing; zero if it tells nothing [m].
    ends : ndarray
        (B, 2) where it ends in the robot's frame [m].
    """
    clear = counts & ((ranges == np.inf) | (ranges == most))
    hits = counts & (ranges >= least) & (ranges > 0.0) & (ranges < most)
    reach = np.where(hits, ranges, np.where(clear, most, 0.0))
    ends = reach[:, None] * along + mount
    if own > 0.0:
        inside = hits & (np.hypot(ends[:, 0], ends[:, 1]) <= own)
        if inside.any():
            hits &= ~inside
            reach[inside], ends[inside] = 0.0, mount
    return hits, clear, reach, ends


def averaged_ranges(
    ranges: Array, hits: Bits, step: float, noise: float, half: float
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
    known = np.full(len(ranges) + 2 * NEIGHBOURS, np.inf, dtype=np.float32)
    known[NEIGHBOURS:-NEIGHBOURS] = np.where(hits, ranges, np.inf)
    own = np.where(hits, ranges, 0.0).astype(np.float32)
    away = sliding_window_view(known, 2 * NEIGHBOURS + 1) - own[:, None]
    beams = np.abs(np.arange(-NEIGHBOURS, NEIGHBOURS + 1, dtype=np.float32))
    same = np.abs(away) <= np.float32(SAME_SURFACE * noise)
    same &= beams * np.float32(step) * own[:, None] <= np.float32(half)
    away[~same] = 0.0
    counts = np.maximum(np.count_nonzero(same, axis=1), 1)
    deviations = noise / np.sqrt(np.minimum(counts, INDEPENDENT))
    return ranges + away.sum(axis=1) / counts, deviations
