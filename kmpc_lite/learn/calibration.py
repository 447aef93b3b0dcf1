"""How a model errs: noise by its sources, and how far held-out drives leave the tube it draws.

The slip of a wheel is heavy-tailed, so a Gaussian quantile of its covariance promises too much.
Here the ellipse around a plan is scaled until it holds the wanted share of drives that the model
has not seen (split conformal prediction, Vovk et al. 2005). No distribution is assumed, only that
later drives are like those held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset, Pieces
from kmpc_lite.learn.ramps import let_through
from kmpc_lite.learn.regression import least_squares
from kmpc_lite.model.arguments import speeds, windows
from kmpc_lite.model.file import Ramps
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel, NoiseSources, design, design_across
from kmpc_lite.model.tube import tube_memory, window_deviations
from kmpc_lite.types import STATES, Array

NOISE_SAMPLES, NOISE_SWEEPS = 250_000, 500
"""Most residuals that the covariance is estimated from: its relative error is then below 1 %;
passes over its three matrices, at most: ten to fifty do."""
LONGEST = 1.0
"""How far ahead predictions are compared with poses [s]: later than that, feedback has acted."""
STARTS, FEWEST, PASSES = 6000, 20, 6
"""Largest number of predictions that are used, and least; passes of the weighted least squares."""
RISKS = (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.003, 0.002, 0.001)
"""Risks that `with_quantiles` tabulates, as far as the held-out drives reach."""
LEAST_RISK = 0.05
"""Risk that the held-out drives must reach: smaller ones are extrapolated, and from the few
numbers of a short log to anything."""
BATCH = 4096  # windows handled at once


def with_noise(model: KoopmanModel, dataset: Dataset) -> KoopmanModel:
    """Return a model with the covariance and the noise sources that drives show."""
    found = fit_noise(model, dataset)
    return replace(model, noise_model=replace(found, sources=split_noise_sources(model, dataset)))


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
    start, goal = (m.reshape(3, STATES, STATES) for m in (weights.T, moments))
    return NoiseModel(_nearest_covariances(gram, goal, start))


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


def prediction_errors(
    model: KoopmanModel, dataset: Dataset, seconds: float = LONGEST
) -> tuple[Array, Array]:
    """Errors of predictions after each period, in the robot's predicted frame, and their commands.

    Returns `errors`, `inputs`: (n, T, 3) [m, m, rad] and (n, T, m); n may be zero.
    """
    steps = max(2, round(seconds / dataset.dt))
    x, before, future = dataset.every_piece(steps, model.history, most=STARTS)
    if not len(x):
        return np.zeros((0, steps, STATES)), future
    predicted = model.rollout(x[:, 0], future, before)[:, 1:]
    return seen_along(x[:, 1:] - predicted, predicted[..., 2]), future


def split_noise_sources(model: KoopmanModel, dataset: Dataset) -> NoiseSources | None:
    """Fit the sources of a model's errors on drives; None if no drive is long enough."""
    errors, inputs = prediction_errors(model, dataset)
    if len(errors) < FEWEST:
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
    """Variances (m,), none negative, that explain squares (n, T) by terms (n, T, m)."""
    from scipy.optimize import nnls  # here, for it takes time to import

    # sums over starts would mix slow and fast driving: each square is one row
    matrix, target = terms.reshape(-1, terms.shape[-1]), squares.reshape(-1)
    weights, found = np.ones(len(target)), np.zeros(matrix.shape[1])
    for _ in range(PASSES):
        weighted = matrix * weights[:, None]
        scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        small = weighted / scale
        # a root of the Gram matrix: a few rows take the place of many thousand
        root = np.linalg.cholesky(small.T @ small + 1e-12 * np.eye(len(scale))).T
        found = nnls(root, np.linalg.solve(root.T, small.T @ (target * weights)))[0] / scale
        expected = matrix @ found
        weights = 1.0 / (expected + 0.02 * expected.mean() + 1e-15)
    return found


def scores(model: KoopmanModel, held_out: Dataset) -> Array:
    """Largest Mahalanobis distance from the plan within each window of held-out driving.

    Windows are as long as the tube remembers. They do not overlap, so that they are as independent
    as the drives allow.

    `model`: its noise model gives the ellipses. `held_out`: drives that the model was not fitted
    to. Returns (n,) dimensionless: the position's deviation under feedback, measured by the ellipse
    of its stage. For a model with noise sources two poses in a row must show it. Raises DataError
    for another dt, or if no episode is as long as a window.
    """
    if abs(held_out.dt - model.dt) > SAME_DT * model.dt:
        raise DataError(
            f"the held-out dataset's dt is {held_out.dt:g} s, the model's {model.dt:g} s: "
            "resample it"
        )
    length, steps = model.history, tube_memory(model)
    pieces = held_out.pieces(steps, length, stride=steps, chunk=BATCH)
    found = [_largest(model, part) for part in pieces]
    if not found:
        longest = max(len(e) for e in held_out.episodes)
        raise DataError(
            f"no held-out episode is as long as a window of {length + steps} steps "
            f"(longest {longest})"
        )
    return np.concatenate(found)


def _largest(model: KoopmanModel, pieces: Pieces) -> Array:
    """Largest score of each window."""
    x, x_next = pieces.states[:, :-1], pieces.states[:, 1:]
    past = None
    if model.history:
        every = np.concatenate([pieces.before, pieces.inputs], axis=1)
        past = windows(every, model.history)
    deviations, covariances = window_deviations(model, x, pieces.inputs, x_next, past)
    squares = np.einsum(
        "nki,nki->nk", deviations, np.linalg.solve(covariances, deviations[..., None])[..., 0]
    )
    if model.noise_model is not None and model.noise_model.sources is not None:
        # no robot jumps and comes back: what only one pose shows is that pose's noise
        squares = np.minimum(squares[:, :-1], squares[:, 1:])
    largest: Array = np.sqrt(squares.max(axis=1))
    return largest


def conformal_quantile(values: Array, risk: float) -> float:
    """Give the smallest bound that a fresh value exceeds with a probability of at most `risk`.

    It holds for any distribution. It is the ``ceil((n + 1)(1 - risk))``-th smallest of n values;
    infinite if n is too small for that.

    Examples
    --------
    >>> conformal_quantile(np.arange(1.0, 100.0), 0.1)
    90.0
    """
    if not 0.0 < risk < 1.0:
        raise DataError(f"risk: expected a probability between 0 and 1, got {risk!r}")
    rank = int(np.ceil((len(values) + 1) * (1.0 - risk) - 1e-9))
    return float(np.partition(values, rank - 1)[rank - 1]) if rank <= len(values) else float("inf")


def with_quantiles(
    model: KoopmanModel, held_out: Dataset, risks: Sequence[float] = RISKS
) -> KoopmanModel:
    """Return the model with a table of calibrated quantiles.

    The table is ``info["noise_quantiles"]``, which `save` keeps. Risks that the held-out drives
    are too few for are left out; `kmpc_lite.control.margins` extends the table
    by its slope.
    """
    values = scores(model, let_through(held_out, Ramps.of(model.info)))
    table = [
        (float(r), q)
        for r in sorted(risks, reverse=True)
        if np.isfinite(q := conformal_quantile(values, r))
    ]
    steps = tube_memory(model)
    if len(table) < 2 or table[-1][0] > LEAST_RISK:
        raise DataError(
            f"{len(values)} held-out windows of {steps} steps are too few to calibrate: "
            "drive longer"
        )
    quantiles = {
        "risks": [r for r, _ in table],
        "quantiles": [q for _, q in table],
        "windows": len(values),
        "steps": steps,
    }
    return replace(model, info={**model.info, "noise_quantiles": quantiles})
