"""How many standard deviations a risk asks for: looked up, extended, and refused where damaged."""

from dataclasses import replace

import numpy as np
import pytest
from wary import PROBLEM, Wary

from kmpc_lite.control.margins.model_noise import default_quantile, model_quantile
from kmpc_lite.errors import ProblemError


def test_quantile_lookup():
    table = {"noise_quantiles": {"risks": [0.1, 0.01], "quantiles": [3.0, 5.0]}}
    assert model_quantile(table, 0.1) == pytest.approx(3.0)
    assert model_quantile(table, 0.1**1.5) == pytest.approx(4.0)
    assert model_quantile(table, 0.001) == pytest.approx(7.0)
    assert model_quantile(table, 0.5) == pytest.approx(3.0)
    assert model_quantile({}, 0.01) == default_quantile(0.01)


def test_default_quantile_covers_both_tails():
    random = np.random.default_rng(0)
    normal = np.hypot(*random.normal(size=(2, 100_000)))
    exponential = np.abs(random.exponential(size=(2, 100_000)) - 1.0).max(axis=0)
    for risk in (0.1, 0.01, 0.001):
        limit = risk + 3 * np.sqrt(risk / 100_000)
        assert (normal > default_quantile(risk)).mean() <= limit
        assert (exponential > default_quantile(risk)).mean() <= limit


@pytest.mark.parametrize(
    "table",
    [
        {"risks": [0.1]},
        {"risks": [0.1], "quantiles": [1.0]},
        {"risks": [0.1, 0.2], "quantiles": [1, 2]},
        {"risks": "x", "quantiles": 1},
        3,
    ],
)
def test_damaged_table(model, table):
    with pytest.raises(ProblemError, match="damaged"):
        Wary(replace(model, info={"noise_quantiles": table}), PROBLEM)
