"""Covariance of a model's one-step errors, and the sources of noise behind errors of any length."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.least_squares import least_squares, nonnegative_least_squares
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.noise_sources import NoiseSources, design, design_across
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
        terms = np.column_stack([np.ones(len(body)), speeds(part.u) ** 2])
        gram += terms.T @ terms
        moments += terms.T @ (body[:, :, None] * body[:, None, :]).reshape(len(body), -1)
    weights, _, _ = least_squares(gram, moments, 0.0)
    return NoiseModel(
        _nearest_covariances(
            gram, moments.reshape(3, STATES, STATES), weights.T.reshape(3, STATES, STATES)
        )
    )


def with_noise(model: KoopmanModel, dataset: Dataset) -> KoopmanModel:
    """Return a model with the covariance and the noise sources that drives show."""
    found = fit_noise(model, dataset)
    return replace(model, noise_model=replace(found, sources=split_noise_sources(model, dataset)))


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


LONGEST = 1.0
"""How far ahead predictions are compared with poses [s]: later than that, feedback has acted."""
STARTS = 6000
"""Largest number of predictions that are used."""
ELLIPSE, ONE_SIDED = 5.991, 1.645
"""Squared radius of the ellipse that holds 95 % of a normal distribution in the plane, and the
bound that 95 % of one on a line stay below."""
AHEAD = 0.5
"""How far ahead predictions are compared with what is expected of them [s]."""
PASSES = 6
"""Passes of the weighted least squares."""


def prediction_errors(
    model: KoopmanModel, dataset: Dataset, seconds: float = LONGEST
) -> tuple[Array, Array]:
    """Errors of predictions after each period, in the robot's predicted frame, and their commands.

    Returns
    -------
    errors, inputs : ndarray
        (n, T, 3) [m, m, rad] and (n, T, 2); n may be zero.
    """
    steps = max(2, round(seconds / dataset.dt))
    x, before, future = dataset.every_piece(steps, model.history, most=STARTS)
    if not len(x):
        return np.zeros((0, steps, STATES)), future
    predicted = model.rollout(x[:, 0], future, before)[:, 1:]
    return seen_along(x[:, 1:] - predicted, predicted[..., 2]), future


@dataclass(frozen=True)
class NoiseCheck:
    """Errors of predictions on held-out drives, and what the sources of a model's noise expect."""

    ahead: float
    """How far ahead [s]."""
    error: float
    """Root mean square of the position's error [m]."""
    expected: float
    """The same, as the noise sources predict it [m]."""
    coverage: float
    """Share of the positions within the ellipses that should hold 95 %."""
    across: float
    """95 % bound of the true pose's lateral error, `ahead` later, straight on at 1 m/s [m]."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """In one line."""
        return (
            f"noise  {self.ahead:g} s ahead the position errs by {100 * self.error:.1f} cm, "
            f"{100 * self.expected:.1f} cm are expected; ellipses of 95 % hold "
            f"{100 * self.coverage:.1f} %; 95 % bound across at 1 m/s {100 * self.across:.1f} cm"
        )


def check_sources(model: KoopmanModel, held: Dataset) -> NoiseCheck | None:
    """Compare a model's noise sources with errors on drives that they were not fitted to.

    Parameters
    ----------
    model : KoopmanModel
        With noise sources; without, None is returned, as when no drive is long enough.
    held : Dataset
        Drives that nothing was fitted to; their poses' own noise is accounted for.
    """
    errors, inputs = prediction_errors(model, held, 2.0 * AHEAD)
    sources = None if model.noise_model is None else model.noise_model.sources
    if sources is None or not len(errors):
        return None
    k = max(1, round(AHEAD / held.dt)) - 1
    position = errors[:, k, :2] ** 2
    expected = sources.open_loop(inputs, held.dt)[:, k, :2]
    straight = np.tile([1.0, 0.0], (k + 1, 1))
    alone = sources.open_loop(straight, held.dt, measured=False)[k, 1]
    return NoiseCheck(
        AHEAD,
        float(np.sqrt(position.sum(axis=1).mean())),
        float(np.sqrt(expected.sum(axis=1).mean())),
        float(((position / np.maximum(expected, 1e-18)).sum(axis=1) < ELLIPSE).mean()),
        float(ONE_SIDED * np.sqrt(alone)),
    )


def split_noise_sources(model: KoopmanModel, dataset: Dataset) -> NoiseSources | None:
    """Fit the sources of a model's errors; None if no drive is long enough.

    Parameters
    ----------
    model : KoopmanModel
        Predicts.
    dataset : Dataset
        Drives with measured poses.
    """
    errors, inputs = prediction_errors(model, dataset)
    if len(errors) < 20:
        return None
    own, led = design(inputs, dataset.dt), design_across(inputs, dataset.dt)
    heading = _variances(own, errors[..., 2] ** 2)
    forward = _variances(own, errors[..., 0] ** 2)
    left = _variances(own, errors[..., 1] ** 2 - led @ heading)
    rows = np.stack([forward, left, heading], axis=1)
    # at rest a position is as noisy ahead as aside
    rows[0, :2] = rows[0, :2].mean()
    return NoiseSources.from_array(rows)


def _variances(terms: Array, squares: Array) -> Array:
    """Variances (m,) that explain squared errors (n, T) by terms (n, T, m)."""
    # sums over starts would mix slow and fast driving: each square is one row
    matrix, target = terms.reshape(-1, terms.shape[-1]), squares.reshape(-1)
    weights = np.ones(len(target))
    found = np.zeros(matrix.shape[1])
    for _ in range(PASSES):
        weighted = matrix * weights[:, None]
        scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        small = weighted / scale
        gram = small.T @ small + 1e-12 * np.eye(len(scale))
        root = np.linalg.cholesky(gram).T
        found = nonnegative_least_squares(root, small.T @ (target * weights)) / scale
        expected = matrix @ found
        weights = 1.0 / (expected + 0.02 * expected.mean() + 1e-15)
    return found
