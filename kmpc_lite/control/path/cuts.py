"""Which obstacles a path cuts, and which others belong to these."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.path.edges import NOTHING, cut_edges
from kmpc_lite.types import Array


def cut_circles(points: Array, centres: Array, radii: Array, depth: float) -> Array:
    """Which circles (M,) a line through points (K, 2) cuts deeper than is allowed.

    Parameters
    ----------
    points : ndarray
        (K, 2) [m].
    centres, radii : ndarray
        (M, 2), (M,) [m].
    depth : float
        What is allowed [m].
    """
    # coordinate by coordinate: half the time of pairs
    x, y = points[:-1, 0, None], points[:-1, 1, None]
    dx, dy = points[1:, 0, None] - x, points[1:, 1, None] - y
    away_x, away_y = centres[:, 0] - x, centres[:, 1] - y
    share = (away_x * dx + away_y * dy) / (dx * dx + dy * dy + NOTHING)
    np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share)
    away_x -= share * dx
    away_y -= share * dy
    squares = away_x * away_x + away_y * away_y
    cut: Array = (squares < np.maximum(radii - depth, 0.0) ** 2).any(axis=0)
    return cut


def cut_obstacles(points: Array, centres: Array, radii: Array, edges: Array, depth: float) -> Array:
    """Which circles (M,) a line through points (K, 2) cuts, or cuts an edge (S, 2) of."""
    cut = cut_circles(points, centres, radii, depth)
    if len(edges):
        first, second = edges.T
        allowed = np.maximum(radii[first] - depth, 0.0)
        cut[edges[cut_edges(points, centres[first], centres[second], allowed)]] = True
    return cut


def with_corners(known: Array, edges: Array) -> Array:
    """Circles (M,) that are known, or corners of a polygon of which one is known."""
    while (half_known := known[edges].any(axis=1) & ~known[edges].all(axis=1)).any():
        known[edges[half_known]] = True
    return known


def with_walls(known: Array, centres: Array, radii: Array, edges: Array) -> Array:
    """Circles (M,) in one wall, of circles that overlap, or in one polygon, with a known one."""
    known = with_corners(known, edges)
    # a building's walls all hang together: of these only those that are met are looked at
    alone = np.ones(len(known), dtype=bool)
    alone[edges] = False
    new = known & alone
    while new.any():
        look = np.flatnonzero(alone & ~known)
        away = centres[look, None] - centres[new]
        overlap = np.einsum("mki,mki->mk", away, away) < (radii[look, None] + radii[new]) ** 2
        new = np.zeros(len(known), dtype=bool)
        new[look[overlap.any(axis=1)]] = True
        known = known | new
    return known
