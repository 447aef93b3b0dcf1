"""How terms are chosen: nested, blocked cross-validation from second moments.

A block's squared error under any weights is a quadratic form in its moments, so fitting without a
fold and judging on it costs two small products, not another pass over the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.windows import squared_errors
from kmpc_lite.types import Array


@dataclass(frozen=True)
class SelectionOptions:
    """How a choice is made."""

    window: float = 1.0
    """Length of the windows that are predicted [s]: about what a plan looks ahead."""
    block: float = 5.0
    """Length of a block [s]: longer than what a disturbance lasts."""
    fewest_blocks: int = 16
    """Short logs are cut into shorter blocks until there are as many."""
    longest: float = 1.0
    """Longest history [s]."""
    most_periods: int = 12
    """Longest history [periods]: each period adds columns to the quadratic program."""
    kept: float = 0.5
    """Share of the windows that must remain after the longest history."""
    significance: float = 0.001
    """Probability at which a worthless explanation may pass, in each direction."""
    most_steps: int = 40_000
    """Steps of the longest log that the choice looks at in full; the fit looks at all."""
    refinements: tuple[float, ...] = (0.5, 0.25, 0.125)
    """Steps by which a chosen response is refined [periods]."""

    def longest_history(self, dt: float) -> int:
        """Longest history at a period [s], in periods."""
        return min(self.most_periods, max(1, round(self.longest / dt)))


FOLDS = 8
"""Parts that are left out in turn."""
CHANCE = 0.05
"""Probability with which more terms are taken that explain nothing."""
RIDGE = 1e-9
"""Share of the scaled moments' diagonals that is added to them."""


@dataclass(frozen=True)
class Candidate:
    """One way to explain the log."""

    fitted: Array
    """Moments whose sum is minimised, (B, p + 1, p + 1)."""
    judged: Array
    """Moments that the error is computed from, (B, p + 1, p + 1)."""
    columns: Array
    """Weights that are free; the others stay as they are in `base`."""
    base: Array
    """Weights of the columns that are not free, (p,)."""
    complexity: int
    """Number of unknowns: of two candidates that err alike, the simpler one is taken."""

    def solve(self, moment: Array) -> Array:
        """Weights (p,) that minimise the squared error of summed moments."""
        return solve_columns(moment, self.columns, self.base)


@dataclass(frozen=True)
class Choice:
    """What cross-validation says of several candidates against a reference."""

    best: int
    """Index of the candidate that is taken."""
    score: float
    """Mean relative gain over the reference a block, in standard errors."""
    errors: Array
    """Squared errors (B,) of each block, of weights chosen and fitted without its fold."""


def solve_columns(moment: Array, columns: Array, base: Array) -> Array:
    """Least squares in some weights, the others held.

    Parameters
    ----------
    moment : ndarray
        Second moments, the target's last, (..., p + 1, p + 1).
    columns : ndarray
        Which weights are free.
    base : ndarray
        All weights before; those not in `columns` keep these values, (p,).

    Returns
    -------
    ndarray
        Weights (..., p).
    """
    weights = np.broadcast_to(base, (*moment.shape[:-2], len(base))).copy()
    if not len(columns):
        return weights
    held = base.copy()
    held[columns] = 0.0
    matrix = moment[..., columns[:, None], columns]
    target = moment[..., columns, -1] - moment[..., columns, :-1] @ held
    scale = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scale = np.where(scale > 0.0, scale, 1.0)
    # what the log does not tell apart is shared out evenly, and what it does not show stays zero
    scaled = matrix / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(len(columns))
    weights[..., columns] = np.linalg.solve(scaled, (target / scale)[..., None])[..., 0] / scale
    return weights


def assign_folds(blocks: int) -> Array:
    """Fold of each block, (B,): contiguous, for what changes slowly."""
    return np.arange(blocks) * min(FOLDS, blocks) // max(blocks, 1)


def cross_validate(
    candidates: Sequence[Candidate], folds: Array, reference: Array, relative: bool = True
) -> Choice:
    """Choose a candidate, and tell what the choice is worth against a reference.

    For each fold, the choice is made by cross-validation among the other folds, the weights are
    fitted to them, and the errors are taken on the fold.

    Parameters
    ----------
    candidates : sequence of Candidate
        All judged on the same windows.
    folds : ndarray
        Fold of each block, (B,).
    reference : ndarray
        Squared errors of each block without any fit, (B,).
    relative : bool
        Whether gains are compared block by block, and not as they are: blocks that were weighed
        have about one size already.
    """
    count, blocks = int(folds.max()) + 1, len(folds)
    one, other = np.triu_indices(count)
    outer = np.zeros((len(candidates), blocks))
    inner = np.zeros((len(candidates), count, blocks))
    for c, candidate in enumerate(candidates):
        parts = np.array([candidate.fitted[folds == k].sum(axis=0) for k in range(count)])
        # leave out one fold where both are the same, else both
        left_out = parts[one] + np.where((one == other)[:, None, None], 0.0, parts[other])
        weights = candidate.solve(parts.sum(axis=0) - left_out)
        errors = squared_errors(candidate.judged, weights)
        for i, j, told in zip(one, other, errors, strict=True):
            if i == j:
                outer[c, folds == i] = told[folds == i]
            else:
                inner[c, i, folds == j] = told[folds == j]
                inner[c, j, folds == i] = told[folds == i]
    complexity = [candidate.complexity for candidate in candidates]
    honest = np.empty(blocks)
    for o in range(count):
        chosen = choose(inner[:, o, folds != o], complexity)
        honest[folds == o] = outer[chosen, folds == o]
    score = gain_score(reference, honest, relative)
    return Choice(choose(outer, complexity), score, honest)


def choose(errors: Array, complexity: Sequence[int]) -> int:
    """Index of the simplest candidate that the best one does not beat beyond chance: errors (C, B).

    Of 20 terms that explain nothing, one is taken.
    """
    total, blocks = errors.sum(axis=1), errors.shape[1]
    best = int(np.argmin(total))
    behind = errors - errors[best]
    spread = behind.std(axis=1, ddof=1) * np.sqrt(blocks)
    near: Array = np.flatnonzero(total - total[best] <= critical_score(blocks, CHANCE) * spread)
    return int(min(near.tolist(), key=lambda c: (complexity[c], total[c])))


def gain_score(reference: Array, errors: Array, relative: bool = True) -> float:
    """Mean over the blocks of the relative gain, in standard errors; never positive without a gain.

    Relative, ``(reference - errors) / (reference + errors)``, for a block in which the robot drives
    fast must not drown those in which it drives slowly.
    """
    total = reference + errors
    gains = reference - errors
    if relative:
        gains = gains / np.where(total > 0.0, total, 1.0)
    mean = float(gains.mean())
    if reference.sum() <= errors.sum():
        mean = min(mean, 0.0)
    spread = float(gains.std(ddof=1)) / np.sqrt(len(gains))
    if spread <= 0.0:
        return float(np.sign(mean) * np.inf) if mean else 0.0
    return float(mean / spread)


def critical_score(blocks: int, significance: float) -> float:
    """Score that a worthless candidate exceeds with a probability of at most `significance`."""
    from scipy.special import stdtrit  # here, for it takes time to import

    return float(stdtrit(blocks - 1, 1.0 - significance))
