"""The bilinear right-hand side of a model, its derivatives, and how it is integrated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.types import STATES, Array

TABLEAUX = {
    "rk4": ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)),
    "midpoint": ((0.0, 0.0), (0.5, 1.0)),
}
"""Explicit Runge-Kutta methods whose stages depend on the stage before only: node and weight of
each."""
_DIAGONAL = np.arange(STATES)


def integrate(f: Callable[[Array], Array], start: Array, dt: float, integrator: str) -> Array:
    """Integrate ``x' = f(x)`` over a period [s] by one of `TABLEAUX`."""
    total, slope = start, start
    for node, weight in TABLEAUX[integrator]:
        slope = f(start + (node * dt) * slope if node else start)
        if weight:
            total = total + (weight * dt) * slope
    return total


@dataclass(frozen=True, eq=False)
class BilinearForm:
    """``f(x, w) = C (A z + B w + H (w (x) z))`` with ``z = phi(x)``, C folded into the others.

    H is kept in two layouts: by input, to form the state-dependent matrix M(w), and by lifted
    coordinate, to form the derivative by w.
    """

    dictionary: Dictionary
    A: Array  # C A, (3, nz)
    B: Array  # C B, (3, nw)
    has_B: bool  # whether any of B is not zero
    H_by_input: Array  # C H, (nw, 3 nz)
    H_by_lift: Array  # C H, (nz, 3 nw)

    @classmethod
    def fold(cls, dictionary: Dictionary, A: Array, B: Array, H: Array, C: Array) -> BilinearForm:
        """Fold the matrices of a model, (nr, nz), (nr, nw), (nr, nw nz) and (3, nr)."""
        nz, nw = dictionary.size, dictionary.input_size
        blocks = (C @ H).reshape(STATES, nw, nz)
        return cls(
            dictionary,
            np.ascontiguousarray(C @ A),
            np.ascontiguousarray(C @ B),
            bool(B.any()),
            np.ascontiguousarray(blocks.transpose(1, 0, 2).reshape(nw, STATES * nz)),
            np.ascontiguousarray(blocks.transpose(2, 0, 1).reshape(nz, STATES * nw)),
        )

    def _input_terms(self, w: Array) -> tuple[Array, Array | None]:
        """Matrix and offset that inputs make of the model: ``M(w) phi(x) + offset``.

        There is no offset where B is zero.
        """
        matrix = (w @ self.H_by_input).reshape(*w.shape[:-1], *self.A.shape) + self.A
        return matrix, w @ self.B.T if self.has_B else None

    def slope(self, w: Array) -> Callable[[Array], Array]:
        """Give `f` as a function of states (..., 3), for inputs (..., nw)."""
        matrix, offset = self._input_terms(w)

        def f(state: Array) -> Array:
            derivative: Array = (matrix @ self.dictionary.lift(state)[..., None])[..., 0]
            return derivative if offset is None else derivative + offset

        return f

    @staticmethod
    def start(x: Array, w: Array) -> Array:
        """States, their derivative by x and by w side by side, (..., 3, 1 + 3 + nw).

        All three travel through the Runge-Kutta stages together: few, large array operations.
        """
        start = np.zeros((*w.shape[:-1], STATES, 1 + STATES + w.shape[-1]))
        start[..., 0] = x
        start[..., _DIAGONAL, 1 + _DIAGONAL] = 1.0
        return start

    def slope_and_derivatives(self, w: Array, start: Array) -> Callable[[Array], Array]:
        """Give `f` and its derivatives as a function of what `start` gives."""
        matrix, offset = self._input_terms(w)

        def f(stage: Array) -> Array:
            expanded = self.dictionary.expand(stage[..., 0])
            product = matrix @ expanded
            slope = np.empty_like(start)
            slope[..., 0] = product[..., 0]
            if offset is not None:
                slope[..., 0] += offset
            by_w = (expanded[..., 0] @ self.H_by_lift).reshape(*w.shape[:-1], *self.B.shape)
            if self.has_B:
                by_w += self.B
            if stage is start:
                # whose derivatives are one and zero
                slope[..., 1 : 1 + STATES], slope[..., 1 + STATES :] = product[..., 1:], by_w
                return slope
            np.matmul(product[..., 1:], stage[..., 1:], out=slope[..., 1:])
            slope[..., 1 + STATES :] += by_w
            return slope

        return f


class Linearization(NamedTuple):
    """First-order expansion of the model at n points.

    ``x+ = value + A dx + B du + sum_j B_past[j] dpast[j]``.
    """

    value: Array  # predicted states, (..., 3)
    A: Array  # derivative by the state, (..., 3, 3)
    B: Array  # derivative by the present command, (..., 3, 2)
    B_past: Array  # derivative by past commands, newest first, (..., L, 3, 2)
