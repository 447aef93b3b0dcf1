"""Fitting from a stream: chunks fitted apart are one fit, and memory and work do not depend on how it is cut."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.dataset import CHUNK

UNICYCLE = kl.UnicycleDictionary()


def drives(episodes: int = 20, steps: int = 60, slip: float = 0.0) -> kl.Dataset:
    """Random driving, as the paper trains."""
    return kl.generate_dataset(kl.DifferentialDrive(slip, 0), episodes=episodes, steps=steps, dt=0.1, seed=0)


def assert_alike(one: kl.KoopmanModel, other: kl.KoopmanModel, tolerance: float) -> None:
    """The same matrices and the same account of the fit."""
    for name in ("A", "B", "H", "C"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=tolerance, err_msg=name)
    assert {**one.info, "condition": 0} == {**other.info, "condition": 0}


@pytest.mark.parametrize("dictionary", [UNICYCLE, kl.InputHistoryDictionary(UNICYCLE, lags=(0, 3), product=True)])
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
            kl.Accumulator(UNICYCLE, 0.1, midpoint=first).merge(kl.Accumulator(UNICYCLE, 0.1, midpoint=midpoint))


# streaming


class Counting(kl.UnicycleDictionary):
    """Counts what is lifted."""

    def __init__(self) -> None:
        self.rows, self.largest = 0, 0

    def lift(self, x: np.ndarray) -> np.ndarray:
        self.rows += len(x)
        self.largest = max(self.largest, len(x))
        return super().lift(x)


@pytest.mark.parametrize("method", ["integral", "edmdc"])
@pytest.mark.parametrize(("episodes", "steps"), [(1, 60_000), (60, 1000), (3, 20_001), (20_000, 3)])
def test_work_is_the_same_for_every_step_and_chunks_stay_small(method: Any, episodes: int, steps: int) -> None:
    random = np.random.default_rng(7)
    data = kl.Dataset([kl.Episode(random.normal(size=(steps + 1, 3)), random.normal(size=(steps, 2)), 0.1) for _ in range(episodes)])
    dictionary = Counting()
    kl.fit(data, dictionary, method=method, noise=False)
    # edmdc lifts both ends of a step; the integral form its middle too, in each of two passes
    assert dictionary.rows == data.steps * (2 if method == "edmdc" else 6)
    assert dictionary.largest < 2 * CHUNK


MEMORY = """
import resource, sys
import kmpc_lite as kl
data = kl.generate_dataset(kl.DifferentialDrive(), episodes=1000, steps=1000, dt=0.1, seed=0)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
model = kl.fit(data, method=sys.argv[1])
print(data.steps, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.parametrize("method", ["integral", "edmdc"])
def test_a_million_samples_grow_the_process_by_less_than_200_mb(method: str) -> None:
    done = subprocess.run([sys.executable, "-c", MEMORY, method], capture_output=True, text=True, check=True)
    steps, kilobytes = map(int, done.stdout.split())
    assert steps == 1_000_000 and kilobytes <= 200_000
    assert done.stderr == ""


@pytest.mark.long
@pytest.mark.parametrize(("method", "limit"), [("edmdc", 15.0), ("integral", 50.0)])
def test_a_million_samples_take_a_few_bare_gram_products(method: Any, limit: float) -> None:
    data = kl.generate_dataset(kl.DifferentialDrive(), episodes=1000, steps=1000, dt=0.1, seed=0)
    rows = np.random.default_rng(8).normal(size=(1_000_000, 20))

    def best(job: Any, times: int = 5) -> float:
        """Shortest of several runs [s]: what the machine can do when nothing else asks for it."""
        spent = []
        for _ in range(times):
            start = time.perf_counter()
            job()
            spent.append(time.perf_counter() - start)
        return min(spent)

    bare = best(lambda: rows.T @ rows)
    fitted = best(lambda: kl.fit(data, method=method))
    assert fitted <= limit * bare, f"{fitted:.3f} s is {fitted / bare:.1f} times the bare product's {bare:.4f} s, at most {limit:g}"
