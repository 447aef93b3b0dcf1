"""Fitting from a stream: chunks fitted apart are one fit, and memory and work do not depend on how
it is cut.
"""

import pickle
from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.bench.fitting import fit_costs, format_fit_costs, memory_growth
from kmpc_lite.learn.dataset import CHUNK

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


@pytest.mark.parametrize("method", ["integral", "edmdc"])
def test_the_order_of_the_episodes_does_not_matter(method: Any) -> None:
    data = drives(slip=0.05)
    order = np.random.default_rng(6).permutation(len(data))
    shuffled = kl.Dataset([data.episodes[i] for i in order])
    one, other = kl.fit(data, method=method), kl.fit(shuffled, method=method)
    assert_alike(one, other, 1e-7)
    np.testing.assert_allclose(one.noise([0.5, 0.5]), other.noise([0.5, 0.5]), rtol=1e-6)


def test_accumulators_of_different_fits_do_not_merge() -> None:
    data = drives()
    first, second = kl.fit(data, noise=False), kl.fit(data, noise=False, ridge=0.1)
    history = kl.InputHistoryDictionary(UNICYCLE, lags=(0, 1))
    mine = kl.Accumulator(history, 0.1)
    for other in (
        kl.Accumulator(history, 0.2),
        kl.Accumulator(history, 0.1, "edmdc"),
        kl.Accumulator(kl.InputHistoryDictionary(UNICYCLE, lags=(0, 2)), 0.1),
        kl.Accumulator(UNICYCLE, 0.1),
    ):
        with pytest.raises(kl.DataError, match="cannot merge"):
            mine.merge(other)
    for midpoint in (None, second):
        with pytest.raises(kl.DataError, match="cannot merge"):
            kl.Accumulator(UNICYCLE, 0.1, midpoint=first).merge(
                kl.Accumulator(UNICYCLE, 0.1, midpoint=midpoint)
            )


# streaming


class Counting(kl.UnicycleDictionary):
    """Counts what is lifted."""

    def __init__(self) -> None:
        super().__init__()
        self.rows, self.largest = 0, 0

    def lift(self, x: np.ndarray) -> np.ndarray:
        self.rows += len(x)
        self.largest = max(self.largest, len(x))
        return super().lift(x)


@pytest.mark.parametrize("method", ["integral", "edmdc"])
@pytest.mark.parametrize(("episodes", "steps"), [(1, 20_000), (20, 1000), (3, 9_001), (5_000, 3)])
def test_work_is_the_same_for_every_step_and_chunks_stay_small(
    method: Any, episodes: int, steps: int
) -> None:
    random = np.random.default_rng(7)
    data = kl.Dataset(
        [
            kl.Episode(random.normal(size=(steps + 1, 3)), random.normal(size=(steps, 2)), 0.1)
            for _ in range(episodes)
        ]
    )
    dictionary = Counting()
    kl.fit(data, dictionary, method=method, noise=False)
    # edmdc lifts both ends of a step; the integral form its middle too, in each of two passes, and
    # each model a single pose
    assert 0 <= dictionary.rows - data.steps * (2 if method == "edmdc" else 6) < 10
    assert dictionary.largest < 2 * CHUNK


@pytest.mark.parametrize("episodes", [250, pytest.param(1000, marks=pytest.mark.long)])
def test_a_million_samples_take_a_few_megabytes(episodes: int) -> None:
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=episodes, steps=1000, dt=0.1, seed=0
    )
    for method in ("integral", "edmdc"):
        grown = memory_growth(data, method)
        # the regressor alone would be 160 for a million
        assert 0.5 <= grown <= (20.0 if episodes < 1000 else 50.0)


@pytest.mark.long
def test_a_million_samples_take_a_few_bare_gram_products() -> None:
    costs = {cost.method: cost for cost in fit_costs()}
    assert costs["edmdc"].ratio <= 15.0 and costs["integral"].ratio <= 50.0, format_fit_costs(
        list(costs.values())
    )


def test_what_a_fit_costs_is_printed_per_method() -> None:
    costs = fit_costs(episodes=2)
    assert [(c.method, c.samples) for c in costs] == [("integral", 2000), ("edmdc", 2000)]
    assert all(
        c.seconds == pytest.approx(c.ratio * c.bare_seconds) and c.seconds > 0.0 for c in costs
    )
    text = format_fit_costs(costs)
    assert "2,000 samples" in text and all(
        f"{c.method:<9} {c.seconds:7.3f} s, {c.ratio:5.1f} times that" in text for c in costs
    )
