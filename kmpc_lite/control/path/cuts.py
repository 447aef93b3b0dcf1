"""Which obstacles a path cuts: circles, and edges between the corners of an obstacle, inflated.

A corner that is inflated is a circle like any other, and an edge between two corners is inflated by
as much as they are.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

NOTHING = 1e-12
"""Square of a length that is none [m^2]: rounding."""


def point_gaps(points: Array, begins: Array, ends: Array) -> Array:
    """Squared distances (K, S) [m^2] of points (K, 2) from edges (S, 2), (S, 2)."""
    step = ends - begins
    reach = points[:, None] - begins
    share = np.einsum(
        "ksi,si->ks", reach, step / (np.einsum("si,si->s", step, step) + NOTHING)[:, None]
    )
    reach -= np.clip(share, 0.0, 1.0)[..., None] * step
    squares: Array = np.einsum("ksi,ksi->ks", reach, reach)
    return squares


def crossings(first: Array, last: Array, begins: Array, ends: Array) -> Array:
    """Which lines from (T, 2) to (T, 2) cross which edges from (S, 2) to (S, 2), (T, S)."""
    step, line = ends - begins, last - first
    beside_first = _cross(step, first[:, None] - begins)
    beside_last = _cross(step, last[:, None] - begins)
    beside_begin = _cross(line[:, None], begins - first[:, None])
    beside_end = _cross(line[:, None], ends - first[:, None])
    crossed: Array = (beside_first * beside_last < 0.0) & (beside_begin * beside_end < 0.0)
    return crossed


def cut_edges(points: Array, begins: Array, ends: Array, radii: Array) -> Array:
    """Which inflated edges (S,) a line through points (K, 2) cuts, without their end circles."""
    cut: Array = np.any(point_gaps(points, begins, ends) < radii**2, axis=0) | np.any(
        crossings(points[:-1], points[1:], begins, ends), axis=0
    )
    return cut


def free_of_edges(first: Array, last: Array, begins: Array, ends: Array, radii: Array) -> Array:
    """Which lines (T,) from (T, 2) to (T, 2) cut no inflated edge, without its end circles."""
    free = np.ones(len(first), dtype=bool)
    squares = radii**2
    # most lines that are barred end inside, which is seen faster
    for points in (first, last):
        look = np.flatnonzero(free)
        free[look] = (point_gaps(points[look], begins, ends) >= squares).all(axis=1)
    look = np.flatnonzero(free)
    free[look] = ~crossings(first[look], last[look], begins, ends).any(axis=1)
    return free


def edge_bars(
    centres: Array, sizes: Array, begins: Array, ends: Array, radii: Array
) -> tuple[Array, Array]:
    """Find a place in each piece of circles (C, 2), (C,) that an inflated edge covers.

    The places are told by numbers of circles (B,) and angles (B,) [rad].

    On a piece of a circle the distance from an edge is least where the edge crosses it, beside the
    foot of its perpendicular, or at an end, where there is another circle.
    """
    step = ends - begins
    length = np.sqrt(np.einsum("si,si->s", step, step)) + NOTHING
    along = step / length[:, None]
    reach = centres[:, None] - begins
    foot = np.einsum("csi,si->cs", reach, along)
    off = reach - foot[..., None] * along
    distance = np.sqrt(np.einsum("csi,csi->cs", off, off))
    own = sizes[:, None]
    beside = (
        (foot > 0.0) & (foot < length) & (np.abs(distance - own) < radii) & (distance > NOTHING)
    )
    half = np.sqrt(np.maximum(own**2 - distance**2, 0.0))
    circles, directions = [np.nonzero(beside)[0]], [-off[beside]]
    for place in (foot - half, foot + half):
        crossed = (half > 0.0) & (place > 0.0) & (place < length)
        circle, edge = np.nonzero(crossed)
        circles.append(circle)
        directions.append(begins[edge] + place[crossed][:, None] * along[edge] - centres[circle])
    away = np.concatenate(directions)
    return np.concatenate(circles), np.arctan2(away[:, 1], away[:, 0])


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


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
