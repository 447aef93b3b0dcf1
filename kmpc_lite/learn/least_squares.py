"""Least squares from second moments: sums over the samples take the place of the samples."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

RANK_TOLERANCE = 1e-13
"""Eigenvalues of the scaled Gram matrix below this share of the largest count as zero."""


def least_squares(gram: Array, moments: Array, ridge: float) -> tuple[Array, int, float]:
    """Weights (q, p) of smallest norm, rank, and condition: G (p, p), moments (p, q)."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > RANK_TOLERANCE * len(values) * values[-1]
    v = vectors[:, kept]
    weights = (v / (values[kept] + ridge)) @ (v.T @ (moments / scale[:, None])) / scale[:, None]
    return weights.T, int(kept.sum()), float(np.sqrt(values[-1] / values[kept][0]))


def nonnegative_least_squares(root: Array, moments: Array) -> Array:
    """Weights (p,), none of them negative: moments (p,), and a root (p, p) of the Gram matrix.

    ``root.T @ root`` is that matrix: a few rows take the place of many thousand.
    """
    from scipy.optimize import nnls  # here, for it takes time to import

    found: Array = nnls(root, np.linalg.solve(root.T, moments))[0]
    return found
