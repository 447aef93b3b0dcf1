"""How many standard deviations a risk asks for: looked up, extended, and refused where damaged."""

from dataclasses import replace

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
