"""The assignment of least cost is found, whatever can be paired."""

import time

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from kmpc_lite.control.kernels.tracks import pairs


@pytest.mark.parametrize("seed", range(10))
def test_the_cost_is_that_of_the_hungarian_method(seed: int) -> None:
    random = np.random.default_rng(seed)
    costs = random.normal(size=random.integers(1, 9, 2))
    rows, columns = pairs(costs)
    best = costs[linear_sum_assignment(costs)]
    assert len(rows) == len(best) == len(set(rows)) == len(set(columns))
    assert costs[rows, columns].sum() == pytest.approx(best.sum())


@pytest.mark.parametrize("seed", range(10))
def test_what_cannot_be_is_not_paired_and_as_much_as_possible_is(seed: int) -> None:
    random = np.random.default_rng(seed)
    costs = random.normal(size=random.integers(1, 7, 2))
    costs[random.random(costs.shape) < 0.6] = np.inf
    rows, columns = pairs(costs)
    assert np.isfinite(costs[rows, columns]).all()
    best = np.where(np.isfinite(costs), costs, 1e6)
    expected = best[linear_sum_assignment(best)]
    assert len(rows) == np.count_nonzero(expected < 1e6)
    assert costs[rows, columns].sum() == pytest.approx(expected[expected < 1e6].sum())


@pytest.mark.parametrize("seed", range(5))
def test_a_crowd_that_can_hardly_be_distinguished_takes_milliseconds(seed: int) -> None:
    random = np.random.default_rng(seed)
    places = random.uniform(-2.0, 2.0, (2, 200, 2))
    costs = np.sum((places[0][:, None] - places[1]) ** 2, axis=2) / random.choice([1e-3, 0.1, 10])
    costs[costs > np.quantile(costs, random.choice([0.02, 0.06, 0.3, 1.0]))] = np.inf
    begun = time.process_time()
    pairs(costs - 9.0)
    assert time.process_time() - begun < 0.3
