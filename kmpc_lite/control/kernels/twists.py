"""Motions at constant speeds: where twists lead, and the poses on the way.

A twist is a robot's speed ahead, to the left, and round (3,); held for a time it leads along an
arc, a straight line, or a turn on the spot. Sizes: any.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.geometry import exact_arc, nearest_turn, seen_along
from kmpc_lite.types import Array


def moved(poses: Array, twists: Array, times: Array) -> Array:
    """Poses (..., 3) after twists (..., 3) were held for times (...)."""
    out: Array = exact_arc(poses, twists[..., 0], twists[..., 2], times, twists[..., 1])
    return out


def seen_from(start: Array, poses: Array) -> Array:
    """Poses (..., 3) in the frame of one (..., 3), their headings in [-pi, pi]."""
    seen = seen_along(poses - start, start[..., 2])
    seen[..., 2] -= nearest_turn(seen[..., 2])
    return seen


def chained(start: Array, twists: Array, times: Array) -> Array:
    """Poses (..., S + 1, 3) at the ends of S twists (..., S, 3) driven one after the other."""
    out = np.empty((*times.shape[:-1], times.shape[-1] + 1, 3))
    out[..., 0, :] = start
    for k in range(times.shape[-1]):
        out[..., k + 1, :] = moved(out[..., k, :], twists[..., k, :], times[..., k])
    return out


def sampled(start: Array, twists: Array, times: Array, counts: Array) -> tuple[Array, Array]:
    """Poses (K, 3) from a start (3,) along S twists, and when they are reached (K,).

    `start`: (3,), the first of them. `twists`, `times`: (S, 3) and (S,). `counts`: (S,) poses on
    each.
    """
    begins = chained(start, twists, times)[:-1]
    piece = np.repeat(np.arange(len(times)), counts)
    first = np.cumsum(counts) - counts
    share = (np.arange(len(piece)) - first[piece] + 1.0) / counts[piece]
    after = share * times[piece]
    poses = moved(begins[piece], twists[piece], after)
    when = (np.cumsum(times) - times)[piece] + after
    return np.concatenate([start[None], poses]), np.concatenate([[0.0], when])


def straight_twist(ends: Array) -> Array:
    """Twists (..., 3) that lead to ends (..., 3), as seen from where they begin, in a unit time."""
    turn = ends[..., 2]
    half = 0.5 * turn
    chord = np.sinc(half / np.pi)
    cos, sin = np.cos(half) / chord, np.sin(half) / chord
    x, y = ends[..., 0], ends[..., 1]
    return np.stack([cos * x + sin * y, cos * y - sin * x, turn], axis=-1)
