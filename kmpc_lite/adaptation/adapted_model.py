"""Applies gains to a learned model, and refuses gains that no floor can cause."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np

from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.state import Gains
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.symmetric import find_trigonometry
from kmpc_lite.scale import UNIT_RADIUS
from kmpc_lite.types import INPUTS, STATES, Array

LARGEST_DRIFT = 0.6
"""Sideways drift as a share of the speed, a crab angle of 31 degrees: a floor that slopes or slips
more makes the robot undrivable."""
STEERED_GAINS = (0.8, 1.25)
"""Gains of steered wheels beyond which a lag is taken for a gain."""
LARGEST_PULL = 0.3
"""Turn to one side per radius driven [rad]: a flat tyre gives a tenth."""


def adapted_model(
    base: KoopmanModel, gains: Gains, noise: NoiseModel, told: dict[str, int]
) -> KoopmanModel:
    """Apply gains to a learned model.

    `base`: the learned one. `gains`: of the velocity ahead and to the left, of the turn rate, the
    pull, and of speeds sideways. `noise`: of the residuals that the gains leave. `told`: what is
    kept in the model's `info` beside the gains.
    """
    mix = np.array(
        [[gains.ahead, -gains.left, 0.0], [gains.left, gains.ahead, 0.0], [0.0, 0.0, gains.turn]]
    )
    b = mix @ base.B
    b[2] += gains.pull * _ahead(base)
    h = mix @ base.H
    if drives_sideways(base):
        h += (gains.aside - gains.ahead) * _driven_sideways(base)
    info = {**base.info, "adaptation": {**gains._asdict(), **told}}
    return replace(base, A=mix @ base.A, H=h, B=b, noise_model=noise, info=info)


def _ahead(model: KoopmanModel) -> Array:
    """How much each bilinear input (nw,) drives the robot ahead."""
    lifted = model.dictionary.lift(np.zeros(STATES))
    terms = model.H.reshape(STATES, -1, len(lifted))[0] @ lifted
    out: Array = terms + model.B[0]
    return out


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
