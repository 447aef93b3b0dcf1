"""What gains make of a learned model and its noise, and which of them a floor can cause."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, sqrt

import numpy as np

from kmpc_lite.adaptation.estimate import residuals
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.state import Gains
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.symmetric import find_trigonometry
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import INPUTS, STATES, Array

LARGEST_DRIFT = 0.6
"""Sideways drift as a share of the speed, a crab angle of 31 degrees: a floor that slopes or slips
more makes the robot undrivable."""
LARGEST_PULL = 0.3
"""Turn to one side per radius driven [rad]: a flat tyre gives a tenth."""
STEERED_GAINS = (0.8, 1.25)
"""Gains of steered wheels beyond which a lag is taken for a gain."""


def adapted_model(
    base: KoopmanModel, gains: Gains, noise: NoiseModel, told: dict[str, int]
) -> KoopmanModel:
    """Apply gains to a learned model; its `info` tells of them, and what else is `told`."""
    mix = np.array(
        [[gains.ahead, -gains.left, 0.0], [gains.left, gains.ahead, 0.0], [0.0, 0.0, gains.turn]]
    )
    h, b = mix @ base.H, mix @ base.B
    # how much each bilinear input drives the robot ahead
    lifted = base.dictionary.lift(np.zeros(STATES))
    b[2] += gains.pull * (base.H.reshape(STATES, -1, len(lifted))[0] @ lifted + base.B[0])
    if drives_sideways(base):
        h += (gains.aside - gains.ahead) * _driven_sideways(base)
    info = {**base.info, "adaptation": {**gains._asdict(), **told}}
    return replace(base, A=mix @ base.A, H=h, B=b, noise_model=noise, info=info)


def drives_sideways(model: KoopmanModel) -> bool:
    """Whether a model's wheels drive sideways, and it tells what they do so from the rest."""
    return model.inputs > INPUTS and model.closed_form is not None


def _driven_sideways(model: KoopmanModel) -> Array:
    """Part of a symmetric model's H (3, nw nz) that leads to the robot's left."""
    place, dictionary = find_trigonometry(model.dictionary), model.dictionary
    assert place is not None and model.closed_form is not None
    out = np.zeros((STATES, dictionary.input_size, dictionary.size))
    left = model.closed_form.motion[:, 1] / model.dt
    out[0, :, place.sin], out[1, :, place.cos] = -left, left
    return out.reshape(STATES, -1)


def residual_covariance(steps: Array, gains: Gains, learned: Array, scale: Scale) -> Array:
    """Covariance (3, 3, 3), by the command, of what gains leave of steps (n,) of `STEP`.

    With few steps it stays near the learned one.
    """
    (ex, ey), (turned, _) = residuals(np.moveaxis(steps["measured"], 0, -1), gains)
    cosine, sine = steps["heading"].T
    errors = np.stack([cosine * ex + sine * ey, cosine * ey - sine * ex, turned], axis=1)
    terms = steps["speeds"]
    expected = np.tensordot(terms, learned[1:], axes=(1, 0)) + learned[0]
    surplus = (errors[:, :, None] * errors[:, None, :] - expected).reshape(len(steps), -1)
    powers = scale.command[[0, -1]] ** 2
    terms = terms / powers
    gram = terms.T @ terms
    gram += np.eye(2) * (0.1 * np.trace(gram) / max(sqrt(len(steps)), 1.0) + 1e-12)
    change = np.linalg.solve(gram, terms.T @ surplus).reshape(2, STATES, STATES)
    coefficients = np.concatenate([learned[:1], learned[1:] + change / powers[:, None, None]])
    # in the robot's units, for metres and radians have no common measure
    between = scale.state * scale.state[:, None]
    values, vectors = np.linalg.eigh(coefficients / between)
    projected = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    out: Array = projected * between
    return out


def refuse(gains: Gains, options: AdaptationOptions, length: float) -> str:
    """Say why no floor can cause these gains; empty if one can.

    `length` is the robot's unit of length [m].
    """
    speed = hypot(gains.ahead, gains.left)
    if not (gains.ahead > 0.0 and options.least_gain < speed < options.largest_gain):
        return f"it comes {gains.ahead:.2g} times as far ahead as the model says"
    if not abs(gains.left) < LARGEST_DRIFT * speed:
        return f"it drifts sideways by {gains.left:.2g} of its speed"
    if not options.least_gain < gains.aside < options.largest_gain:
        return f"it comes {gains.aside:.2g} times as far sideways as the model says"
    if not options.least_gain < gains.turn < options.largest_gain:
        return f"it turns {gains.turn:.2g} times as far as the model says"
    if not abs(gains.pull) * UNIT_RADIUS * length < LARGEST_PULL:
        return f"it pulls to one side by {gains.pull:.2g} rad/m"
    return ""


def lag_taken_for_gain(gains: Gains) -> str:
    """Say why gains of steered wheels are a lag's; empty if they are not."""
    least, most = STEERED_GAINS
    for name, gain in (("ahead", gains.ahead), ("turn", gains.turn)):
        if not least <= gain <= most:
            return (
                f"adaptation ended: a gain {name} of {gain:.2f} of the learned one is beyond "
                f"{least:g} to {most:g}; steering or motor lag more than the model says"
            )
    return ""
