"""Tell the pose's noise, white noise of the motion and lasting errors of the gains apart.

They grow differently with time, so errors one, two, three and more periods ahead tell them apart:
variances that are not negative are fitted to the squares of such errors, each weighed by what is
expected of it.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_sources import NoiseSources, design, design_across
from kmpc_lite.types import Array

LONGEST = 1.0
"""How far ahead the errors look [s]: beyond, feedback has acted."""
STARTS = 6000
"""Predictions that are looked at, at most."""
PASSES = 6
"""Passes of the weighted least squares."""


def prediction_errors(
    model: KoopmanModel, dataset: Dataset, seconds: float = LONGEST, most: int = STARTS
) -> tuple[Array, Array]:
    """Errors of predictions after each period, in the robot's predicted frame, and their commands.

    Returns
    -------
    errors, inputs : ndarray
        (n, T, 3) [m, m, rad] and (n, T, 2); n may be zero.
    """
    steps = max(2, round(seconds / dataset.dt))
    poses, commands = [], []
    for episode in dataset.episodes:
        starts = np.arange(model.history, len(episode) - steps + 1)
        if len(starts):
            poses.append(episode.states[starts[:, None] + np.arange(steps + 1)])
            commands.append(episode.inputs[starts[:, None] + np.arange(-model.history, steps)])
    if not poses:
        return np.zeros((0, steps, 3)), np.zeros((0, steps, 2))
    every = -(-sum(len(p) for p in poses) // most)
    x, u = np.concatenate(poses)[::every], np.concatenate(commands)[::every]
    future, past = u[:, model.history :], u[:, : model.history]
    predicted = model.rollout(x[:, 0], future, past)[:, 1:]
    error = x[:, 1:] - predicted
    cos, sin = np.cos(predicted[..., 2]), np.sin(predicted[..., 2])
    forward = cos * error[..., 0] + sin * error[..., 1]
    left = cos * error[..., 1] - sin * error[..., 0]
    return np.stack([forward, left, error[..., 2]], axis=-1), future


def split_noise_sources(model: KoopmanModel, dataset: Dataset) -> NoiseSources | None:
    """Fit the sources of a model's errors; None where no drive is long enough.

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
    return NoiseSources(rows[0], rows[1:3], rows[3:5])


def _variances(terms: Array, squares: Array) -> Array:
    """Five variances that explain squared errors (n, T) by terms (n, T, 5)."""
    from scipy.optimize import nnls  # here, for it takes time to import

    # sums over starts would mix slow and fast driving: each square is one row
    matrix, target = terms.reshape(-1, terms.shape[-1]), squares.reshape(-1)
    weights = np.ones(len(target))
    found = np.zeros(matrix.shape[1])
    for _ in range(PASSES):
        weighted = matrix * weights[:, None]
        scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        small = weighted / scale
        # normal equations, factored: nnls on five rows instead of many thousand
        gram = small.T @ small + 1e-12 * np.eye(len(scale))
        root = np.linalg.cholesky(gram).T
        aim = np.linalg.solve(root.T, small.T @ (target * weights))
        found = nnls(root, aim)[0] / scale
        expected = matrix @ found
        weights = 1.0 / (expected + 0.02 * expected.mean() + 1e-15)
    return found
