"""Fitting from a stream: chunks fitted apart are one fit."""

import pickle
from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl

UNICYCLE = kl.UnicycleDictionary()


def drives(episodes: int = 20, steps: int = 60, slip: float = 0.0) -> kl.Dataset:
    """Random driving, as the paper trains."""
    return kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(slip, 0), episodes=episodes, steps=steps, dt=0.1, seed=0
    )


def assert_alike(one: kl.KoopmanModel, other: kl.KoopmanModel, tolerance: float) -> None:
    """The same matrices and the same account of the fit."""
    for name in ("A", "B", "H", "C"):
        np.testing.assert_allclose(
            getattr(one, name), getattr(other, name), rtol=0, atol=tolerance, err_msg=name
        )
    assert {**one.info, "condition": 0} == {**other.info, "condition": 0}


@pytest.mark.parametrize(
    "dictionary", [UNICYCLE, kl.InputHistoryDictionary(UNICYCLE, lags=(0, 3), product=True)]
)
@pytest.mark.parametrize("method", ["integral", "edmdc"])
def test_merged_accumulators_are_one(dictionary: kl.Dictionary, method: Any) -> None:
    data = drives(slip=0.05)
    midpoint = kl.fit(data, dictionary, noise=False) if method == "integral" else None
    whole = kl.Accumulator(dictionary, 0.1, method, midpoint)
    whole.add(data)
    merged = kl.Accumulator(dictionary, 0.1, method, midpoint)
    for first in range(0, 20, 3):
        part = kl.Accumulator(dictionary, 0.1, method, midpoint)
        part.add(kl.Dataset(data.episodes[first : first + 3]))
        merged.merge(pickle.loads(pickle.dumps(part)))  # as it comes from another process
    assert merged.count == whole.count == sum(len(e) - dictionary.history for e in data.episodes)
    assert_alike(merged.solve(), whole.solve(), 1e-7)
    assert_alike(whole.solve(), kl.fit(data, dictionary, method=method, noise=False), 1e-7)
