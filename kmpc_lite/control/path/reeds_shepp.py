"""Shortest curves between poses for a car that drives either way: the words of Reeds and Shepp.

Lengths are in turning radii; a curve is at most five segments, each an arc to the left, an arc to
the right or a straight, driven ahead (length above zero) or backwards. J. A. Reeds and L. A. Shepp,
"Optimal paths for a car that goes both forwards and backwards", Pacific J. Math. 145 (1990); the
numbers of its formulas stand beside them. Sizes: n ends, W = 52 words.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kmpc_lite.types import Array

ROUNDING = 1e-10
SEGMENTS = 5
HALF = 0.5 * np.pi
Word = tuple[Array, Array, Array, Array]
"""Lengths t, u, v of a word's segments (n,), and which ends it reaches."""


def _wrapped(angle: Array) -> Array:
    out: Array = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    return out


def _root(squares: Array) -> Array:
    out: Array = np.sqrt(np.maximum(squares, 0.0))
    return out


def _lsl(x: Array, y: Array, phi: Array) -> Word:
    """8.1: left, straight, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    t = np.arctan2(dy, dx)
    v = _wrapped(phi - t)
    return t, np.hypot(dx, dy), v, (t >= -ROUNDING) & (v >= -ROUNDING)


def _lsr(x: Array, y: Array, phi: Array) -> Word:
    """8.2: left, straight, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    square = dx * dx + dy * dy
    u = _root(square - 4.0)
    t = _wrapped(np.arctan2(dy, dx) + np.arctan2(2.0, u))
    v = _wrapped(t - phi)
    return t, u, v, (square >= 4.0) & (t >= -ROUNDING) & (v >= -ROUNDING)


def _lrl(x: Array, y: Array, phi: Array) -> Word:
    """8.3 and 8.4: left, right backwards, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    far = np.hypot(dx, dy)
    u = -2.0 * np.arcsin(np.minimum(0.25 * far, 1.0))
    t = _wrapped(np.arctan2(dy, dx) + 0.5 * u + np.pi)
    v = _wrapped(phi - t + u)
    return t, u, v, (far <= 4.0) & (t >= -ROUNDING)


def _outer(u: Array, v: Array, dx: Array, dy: Array, phi: Array) -> tuple[Array, Array]:
    """First and last arc of a word whose two middle arcs are u and v."""
    delta = _wrapped(u - v)
    a, b = np.sin(u) - np.sin(delta), np.cos(u) - np.cos(delta) - 1.0
    angle = np.arctan2(dy * a - dx * b, dx * a + dy * b)
    flips = 2.0 * (np.cos(delta) - np.cos(v) - np.cos(u)) + 3.0 < 0.0
    t = _wrapped(angle + np.pi * flips)
    return t, _wrapped(t - u + v - phi)


def _lrlr_even(x: Array, y: Array, phi: Array) -> Word:
    """8.7: left, right ahead; left, right backwards."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = 0.25 * (2.0 + np.hypot(dx, dy))
    u = np.arccos(np.minimum(rho, 1.0))
    t, v = _outer(u, -u, dx, dy, phi)
    return t, u, v, (rho <= 1.0) & (t >= -ROUNDING) & (v <= ROUNDING)


def _lrlr_odd(x: Array, y: Array, phi: Array) -> Word:
    """8.8: left, two arcs backwards, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = (20.0 - dx * dx - dy * dy) / 16.0
    u = -np.arccos(np.clip(rho, 0.0, 1.0))
    t, v = _outer(u, u, dx, dy, phi)
    return t, u, v, (rho >= 0.0) & (rho <= 1.0) & (t >= -ROUNDING) & (v >= -ROUNDING)


def _lrsl(x: Array, y: Array, phi: Array) -> Word:
    """8.9: left, a quarter right backwards, straight, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    rho = np.hypot(dx, dy)
    r = _root(rho * rho - 4.0)
    t = _wrapped(np.arctan2(dy, dx) + np.arctan2(r, -2.0))
    v = _wrapped(phi - HALF - t)
    u = 2.0 - r
    return t, u, v, (rho >= 2.0) & (t >= -ROUNDING) & (u <= ROUNDING) & (v <= ROUNDING)


def _lrsr(x: Array, y: Array, phi: Array) -> Word:
    """8.10: left, a quarter right backwards, straight, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = np.hypot(dx, dy)
    t = np.arctan2(dx, -dy)
    u, v = 2.0 - rho, _wrapped(t + HALF - phi)
    return t, u, v, (rho >= 2.0) & (t >= -ROUNDING) & (u <= ROUNDING) & (v <= ROUNDING)


def _lrslr(x: Array, y: Array, phi: Array) -> Word:
    """8.11: left, a quarter right backwards, straight, a quarter left backwards, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = np.hypot(dx, dy)
    u = 4.0 - _root(rho * rho - 4.0)
    t = _wrapped(np.arctan2((4.0 - u) * dx - 2.0 * dy, -2.0 * dx + (u - 4.0) * dy))
    v = _wrapped(t - phi)
    return t, u, v, (rho >= 2.0) & (u <= ROUNDING) & (t >= -ROUNDING) & (v >= -ROUNDING)


Formula = Callable[[Array, Array, Array], Word]
# formula, turns of its segments (1 left, -1 right), where t, u, v go, their factors, what is fixed,
# and whether the curve is looked at from its end
FORMULAS: tuple[tuple[Formula, tuple[int, ...], str, bool], ...] = (
    (_lsl, (1, 0, 1, 0, 0), "tuv", False),
    (_lsr, (1, 0, -1, 0, 0), "tuv", False),
    (_lrl, (1, -1, 1, 0, 0), "tuv", False),
    (_lrl, (1, -1, 1, 0, 0), "vut", True),
    (_lrlr_even, (1, -1, 1, -1, 0), "tuUv", False),
    (_lrlr_odd, (1, -1, 1, -1, 0), "tuuv", False),
    (_lrsl, (1, -1, 0, 1, 0), "tquv", False),
    (_lrsl, (1, 0, -1, 1, 0), "vuqt", True),
    (_lrsr, (1, -1, 0, -1, 0), "tquv", False),
    (_lrsr, (-1, 0, -1, 1, 0), "vuqt", True),
    (_lrslr, (1, -1, 0, 1, -1), "tquqv", False),
)
"""Each with the turns of its segments (1 left, -1 right), what their lengths are (U: -u; q: a
quarter backwards), and whether the curve is looked at from its end."""
FLIPS = np.array(((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)))
"""Each word also driven in the other gears, and mirrored."""
TURNS = np.concatenate([FLIPS[:, 1:] * np.array(turns) for _, turns, _, _ in FORMULAS])
"""(W, 5) turn of each segment: 1 to the left, -1 to the right, 0 straight."""


def curves(ends: Array) -> Array:
    """Lengths (n, W, 5) of the segments of all words to ends (n, 3), infinite of those not reached.

    `ends`: (n, 3) as seen from where the curves begin [turning radii, rad].
    """
    gear, side = FLIPS.T[..., None]
    x, y, phi = gear * ends[:, 0], side * ends[:, 1], gear * side * ends[:, 2]
    sin, cos = np.sin(phi), np.cos(phi)
    seen_back = x * cos + y * sin, x * sin - y * cos
    out = np.zeros((len(FORMULAS), len(FLIPS), len(ends), SEGMENTS))
    for lengths, (formula, _, parts, backwards) in zip(out, FORMULAS, strict=True):
        t, u, v, reached = formula(*(seen_back if backwards else (x, y)), phi)
        values = {"t": t, "u": u, "U": -u, "v": v, "q": np.full_like(t, -HALF)}
        for k, part in enumerate(parts):
            lengths[..., k] = np.where(reached, gear * values[part], np.inf)
    return np.moveaxis(out.reshape(-1, len(ends), SEGMENTS), 0, 1)
