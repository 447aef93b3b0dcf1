"""How much each step counts: by the noise that steps of its speed have."""

from __future__ import annotations

import numpy as np

from kmpc_lite.adaptation.gains import reweighed_sums
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.regressor import Regressor
from kmpc_lite.adaptation.state import AdaptationState
from kmpc_lite.types import Array


def kept_steps(state: AdaptationState, count: int) -> Array:
    """Indices of the newest steps in the ring of steps, newest first."""
    kept: Array = (state.count - 1 - np.arange(count)) % len(state.raw)
    return kept


def weigh_by(state: AdaptationState, coefficients: Array) -> None:
    """Weigh coming steps by a covariance (3, 3, 3), as `NoiseModel` has it."""
    state.position_noise = [float(c[0, 0] + c[1, 1]) / 2 for c in coefficients]
    state.heading_noise = [float(c[2, 2]) for c in coefficients]


def reweigh(
    state: AdaptationState, coefficients: Array, regressor: Regressor, options: AdaptationOptions
) -> None:
    """Weigh the steps since the change anew, by the present estimate of their noise (3, 3, 3).

    With the old weights, the tails of a larger noise would look like changes.
    """
    weigh_by(state, coefficients)
    window, memory = len(state.recent), len(state.raw)
    count = min(state.since, memory)
    kept = kept_steps(state, count)
    steps = state.raw[kept]
    sums, usual = reweighed_sums(
        steps,
        np.array([state.position_noise, state.heading_noise]),
        np.array(regressor.floors),
        np.array(regressor.white),
        options.even_noise,
    )
    state.raw[kept], state.usual = steps, usual
    recent = min(count, window)
    state.recent[(state.count - 1 - np.arange(recent)) % window] = sums[:recent]
    fading = (1.0 - 1.0 / memory) ** np.arange(count)
    state.slow, state.slow_count = fading @ sums, float(fading.sum())
