"""Conformal quantiles: how far held-out drives leave the tube that the learned covariance draws.

The slip of a wheel is heavy-tailed, so a Gaussian quantile of its covariance promises too much.
Here the ellipse around a plan is scaled until it holds the wanted share of drives that the model
has not seen (split conformal prediction, Vovk et al. 2005). No distribution is assumed, only that
later drives are like those held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.learn.dataset import Dataset, Pieces
from kmpc_lite.learn.ramps import let_through
from kmpc_lite.model.arguments import windows
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.ramps import Ramps
from kmpc_lite.model.tube import tube_memory, window_deviations
from kmpc_lite.types import Array

RISKS = (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.003, 0.002, 0.001)
"""Risks that `with_quantiles` tabulates, as far as the held-out drives reach."""
LEAST_RISK = 0.05
"""Risk that the held-out drives must reach: smaller ones are extrapolated, and from the few
numbers of a short log to anything."""
BATCH = 4096
"""Windows handled at once."""


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
    are too few for are left out; `kmpc_lite.control.margins.model_noise` extends the table by its
    slope.
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
