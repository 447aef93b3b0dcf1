"""A model with the terms that a log supports, and a record of the choice.

Behind ``lags="auto"``, and ages of commands that are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kmpc_lite.learn.checks.drives import refuse_car_like, refuse_frozen
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.selection import Selection, select
from kmpc_lite.learn.selection_options import SelectionOptions
from kmpc_lite.learn.symmetry import require_trigonometry, symmetric_generator
from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.model.dictionary.response import LINEAR, TERMS, ResponseDictionary
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import STATES


def fit_supported_terms(
    dataset: Dataset,
    base: Dictionary,
    options: SelectionOptions | None = None,
    ages: Sequence[int] = (),
) -> KoopmanModel:
    """Learn the terms that a log supports; where it supports none, the nominal unicycle.

    Parameters
    ----------
    dataset : Dataset
        What is learned from.
    base : Dictionary
        How the pose is lifted; holds 1, cos(theta) and sin(theta).
    options : SelectionOptions, optional
        How the choice is made.
    ages : sequence of int
        Of the commands that act [periods], where that is no choice.
    """
    require_trigonometry(base)
    refuse_frozen(dataset)
    refuse_car_like(dataset)
    return build_model(select(dataset, options, ages), base, dataset.dt)


def build_model(selection: Selection, base: Dictionary, dt: float) -> KoopmanModel:
    """Write the selected rows in the paper's bilinear form, with as few inputs as they need."""
    rows = np.array(selection.rows)
    used = [t for i, t in enumerate(TERMS) if t in LINEAR or rows[:, i].any()]
    speed = selection.speed.weights(dt, selection.longest)
    turn = selection.turn.weights(dt, selection.longest)
    dictionary = base
    if len(used) > len(LINEAR) or len(speed) > 1 or len(turn) > 1:
        dictionary = ResponseDictionary(
            base, speed, turn, used, selection.smoothing, selection.limits
        )
    kept = rows[:, [TERMS.index(t) for t in used]]
    nz, nw = dictionary.size, dictionary.input_size
    return KoopmanModel(
        dictionary,
        dt,
        np.zeros((STATES, nz)),
        np.zeros((STATES, nw)),
        symmetric_generator(dictionary, *kept),
        np.eye(STATES),
        continuous=True,
        info=describe_selection(selection, used),
    )


def describe_selection(selection: Selection, used: list[str]) -> dict[str, Any]:
    """What was chosen, as values that JSON can hold."""
    directions = {
        name: {
            "step": direction.step,
            "score": _finite(direction.score),
            "critical": _finite(direction.critical),
        }
        for name, direction in (
            ("along", selection.along),
            ("across", selection.across),
            ("heading", selection.heading),
        )
    }
    return {
        "method": "integral",
        "symmetric": True,
        "samples": selection.windows,
        "rank": len(used),
        "features": len(used),
        "condition": selection.condition,
        "response": {
            "speed": selection.speed.described(),
            "turn": selection.turn.described(),
            "longest": selection.longest,
        },
        "selection": {
            "directions": directions,
            "terms": used,
            "rows": np.array(selection.rows).tolist(),
            "blocks": selection.blocks,
        },
    }


def _finite(value: float) -> float | None:
    """A number that JSON can hold, or None."""
    return float(value) if np.isfinite(value) else None
