"""Terms of filtered commands by which a robot moves: linear ones, slip, and gains by direction.

Each is a product of one factor of each speed; see `FACTORS`. Each vanishes at rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.types import INPUTS, Array

ONE, PLAIN, SIZE, SQUARE, CUBE, SIGNED_SQUARE, SIGN = FACTORS = range(7)
"""Of a speed s: 1, s, |s|, s^2, s^3, s|s| and the sign of s. ``|s|`` is smoothed to ``s^2 /
sqrt(s^2 + eps^2)``, which is even, and zero with its slope at zero; the sign is smoothed alike."""
LINEAR = ("v", "omega")
"""Terms of a robot that does not slip."""
_TERMS = {
    "v": (PLAIN, ONE),
    "omega": (ONE, PLAIN),
    "v*omega": (PLAIN, PLAIN),
    "v*|omega|": (PLAIN, SIZE),
    "v*omega^2": (PLAIN, SQUARE),
    "v*|v|": (SIGNED_SQUARE, ONE),
    "omega*|omega|": (ONE, SIGNED_SQUARE),
    "omega^3": (ONE, CUBE),
    "v^2*omega": (SQUARE, PLAIN),
    "|v|": (SIZE, ONE),
    "omega*sgn(v)": (SIGN, PLAIN),
}
_OMNI_TERMS = {
    "v": (PLAIN, ONE, ONE),
    "lateral": (ONE, PLAIN, ONE),
    "omega": (ONE, ONE, PLAIN),
    "v*omega": (PLAIN, ONE, PLAIN),
    "lateral*omega": (ONE, PLAIN, PLAIN),
    "v*|v|": (SIGNED_SQUARE, ONE, ONE),
    "lateral*|lateral|": (ONE, SIGNED_SQUARE, ONE),
    "omega*|omega|": (ONE, ONE, SIGNED_SQUARE),
}
TERMS = tuple(_TERMS)
"""Of robots with two speeds; the C code has them in this order."""
OMNI_TERMS = tuple(_OMNI_TERMS)
"""Of robots that drive sideways, too."""
_KINDS = {len(next(iter(t.values()))): np.array(list(t.values())) for t in (_TERMS, _OMNI_TERMS)}


def terms_of(commands: int) -> tuple[str, ...]:
    """Terms of a robot whose commands are so many numbers; the first of them are linear."""
    return TERMS if commands == INPUTS else OMNI_TERMS


def evaluate_terms(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """All terms of filtered commands (..., m): (..., T).

    Beyond the limits, the log's largest speeds, all but the linear ones stay what they are there.
    """
    m = answered.shape[-1]
    out: Array = np.prod(_chosen(_factors(answered, smoothing, limits)), axis=-2)
    out[..., :m] = answered
    return out


def differentiate_terms(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """Slopes of `evaluate_terms` by the filtered commands, by which plans are steered: (..., T, m).

    They are its derivatives but for ``|omega|`` and ``omega^2``, whose slopes are zero here:
    turning either way costs speed. That is predicted, not steered with. Linearised where it turns
    left, less turning is more speed, where it turns right the reverse, and a plan that steers by
    that jumps across in every period.
    """
    m = answered.shape[-1]
    factors = _chosen(_factors(answered, smoothing, limits))
    slopes = _chosen(_slopes(answered, smoothing, limits))
    out = np.empty((*answered.shape[:-1], factors.shape[-1], m))
    for j in range(m):
        others = np.prod(np.delete(factors, j, axis=-2), axis=-2)
        out[..., j] = others * slopes[..., j, :]
    out[..., :m, :] = np.eye(m)
    return out


def _chosen(factors: Array) -> Array:
    """Factor of each speed in each term, (..., m, T): factors (..., m, F)."""
    m = factors.shape[-2]
    found: Array = factors[..., np.arange(m)[:, None], _KINDS[m].T]
    return found


def _factors(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """`FACTORS` of each speed, (..., m, F)."""
    most = np.asarray(limits)
    s = np.clip(answered, -most, most)
    square = s * s
    root = np.sqrt(square + np.square(np.asarray(smoothing)))
    size = square / root
    return np.stack([np.ones_like(s), s, size, square, s * square, s * size, s / root], axis=-1)


def _slopes(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """Slopes of `_factors` by the speed, (..., m, F); see `differentiate_terms`."""
    most, soft = np.asarray(limits), np.square(np.asarray(smoothing))
    s = np.clip(answered, -most, most)
    square = s * s
    cube = (square + soft) * np.sqrt(square + soft)
    size, steep = square / np.sqrt(square + soft), s * (square + 2.0 * soft) / cube
    none, one = np.zeros_like(s), np.ones_like(s)
    found = [none, one, steep, 2.0 * s, 3.0 * square, size + s * steep, soft / cube]
    out: Array = np.stack(found, axis=-1) * (np.abs(answered) <= most)[..., None]
    out[..., -1, [SIZE, SQUARE]] = 0.0
    return out
