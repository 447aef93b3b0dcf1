"""Fitting from a stream: chunk by chunk is one fit."""

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


@pytest.mark.parametrize(
    "dictionary", [UNICYCLE, kl.InputHistoryDictionary(UNICYCLE, lags=(0, 3), product=True)]
)
@pytest.mark.parametrize("method", ["integral", "edmdc"])
def test_chunk_by_chunk_is_one_fit(dictionary: kl.Dictionary, method: Any) -> None:
    data = drives(slip=0.05)
    midpoint = kl.fit(data, dictionary, noise=False) if method == "integral" else None
    seen = kl.Accumulator(dictionary, 0.1, method, midpoint)
    for first in range(0, 20, 3):
        seen.add(kl.Dataset(data.episodes[first : first + 3]))
    assert seen.count == sum(len(e) - dictionary.history for e in data.episodes)
    ours, whole = seen.solve(), kl.fit(data, dictionary, method=method, noise=False)
    for name in ("A", "B", "H", "C"):
        np.testing.assert_allclose(getattr(ours, name), getattr(whole, name), rtol=0, atol=1e-7)
    assert {**ours.info, "condition": 0} == {**whole.info, "condition": 0}
