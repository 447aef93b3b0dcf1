"""Models of every kind with no structure to hide behind."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl

TRIG = kl.HermiteTrigDictionary(0)
UNICYCLE = kl.UnicycleDictionary()
DICTIONARIES = {
    "unicycle": UNICYCLE,
    "trig": TRIG,
    "hermite 2": kl.HermiteTrigDictionary(2),
    "history": kl.InputHistoryDictionary(UNICYCLE, lags=(0, 1, 3)),
    "delay and product": kl.InputHistoryDictionary(TRIG, lags=(2, 1), product=True),
    "present product": kl.InputHistoryDictionary(TRIG, lags=(0,), product=True),
}


def random_model(
    dictionary: kl.Dictionary, continuous: bool, integrator: str = "rk4", seed: int = 0
) -> kl.KoopmanModel:
    """A model with no structure to hide behind."""
    random = np.random.default_rng(seed)
    nz, nw = dictionary.size, dictionary.input_size
    rows = 3 if continuous else nz
    a, b, h = (random.normal(size=(rows, columns)) / (3 * nz) for columns in (nz, nw, nw * nz))
    c = np.eye(3) if continuous else random.normal(size=(3, nz))
    return kl.KoopmanModel(dictionary, 0.1, a, b, h, c, continuous, integrator=integrator)


KINDS = {"integral": (True, "rk4"), "midpoint": (True, "midpoint"), "edmdc": (False, "rk4")}
MODELS = [
    pytest.param(random_model(d, *k), id=f"{n}, {kind}")
    for n, d in DICTIONARIES.items()
    for kind, k in KINDS.items()
]
every_model = pytest.mark.parametrize("model", MODELS)


def points(
    model: kl.KoopmanModel, *lead: int, seed: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, commands and histories with any leading axes."""
    random = np.random.default_rng(seed)
    return (
        random.normal(size=(*lead, 3)),
        random.normal(size=(*lead, 2)),
        random.normal(size=(*lead, model.history, 2)),
    )
