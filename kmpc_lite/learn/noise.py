"""The covariance of a model's one-step errors, as a function of the command."""

from __future__ import annotations

from itertools import islice

import numpy as np

from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.least_squares import least_squares
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.types import STATES, Array

NOISE_SAMPLES = 250_000
"""Most residuals that the covariance is estimated from: its relative error is then below 1 %."""
NOISE_SWEEPS = 500
"""Passes over its three matrices, at most; ten to fifty do."""


def fit_noise(model: KoopmanModel, dataset: Dataset) -> NoiseModel:
    """Regress residuals' outer products, in the robot's frame, on ``[1, v^2, omega^2]``.

    At most about NOISE_SAMPLES steps are looked at, spread evenly over the dataset. Each
    coefficient matrix is kept positive semidefinite, so every covariance is.
    """
    gram, moments = np.zeros((3, 3)), np.zeros((3, STATES * STATES))
    every = -(-dataset.steps // NOISE_SAMPLES)
    for part in islice(dataset.transitions(model.history), 0, None, every):
        error = part.x_next - model.advance(part.x, model.dictionary.inputs(part.u, part.history))
        body = seen_along(error, part.x[:, 2])
        terms = np.column_stack([np.ones(len(body)), part.u[:, 0] ** 2, part.u[:, 1] ** 2])
        gram += terms.T @ terms
        moments += terms.T @ (body[:, :, None] * body[:, None, :]).reshape(len(body), -1)
    weights, _, _ = least_squares(gram, moments, 0.0)
    return NoiseModel(
        _nearest_covariances(
            gram, moments.reshape(3, STATES, STATES), weights.T.reshape(3, STATES, STATES)
        )
    )


def _nearest_covariances(gram: Array, moments: Array, start: Array) -> Array:
    """Least squares over three positive semidefinite matrices, in turn until nothing moves.

    Projecting each unconstrained matrix by itself would only widen the covariances: the tube of a
    real robot became too wide by a fifth.
    """
    s = np.array([_semidefinite(c) for c in start])
    for _ in range(NOISE_SWEEPS):
        before = s.copy()
        for i in np.flatnonzero(np.diag(gram) > 0.0):
            others = np.tensordot(np.delete(gram[i], i), np.delete(s, i, axis=0), axes=1)
            s[i] = _semidefinite((moments[i] - others) / gram[i, i])
        if np.abs(s - before).max() <= 1e-9 * np.abs(s).max():
            break
    return s


def _semidefinite(matrix: Array) -> Array:
    """Nearest positive semidefinite matrix, symmetric to the last bit."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    roots = vectors * np.sqrt(np.maximum(values, 0.0))
    product: Array = np.einsum("ik,jk->ij", roots, roots)
    return product
