"""How many standard deviations a risk asks for: looked up, extended, and refused where damaged."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from wary import PROBLEM, Wary

import kmpc_lite as kl
from kmpc_lite.control.margins.model_noise import ModelNoise, default_quantile, model_quantile
from kmpc_lite.control.options import MarginOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.koopman import KoopmanModel


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


def test_quantiles_survive_a_file(model, tmp_path):
    model.save(tmp_path / "m.npz")
    loaded = KoopmanModel.load(tmp_path / "m.npz")
    assert Wary(loaded, PROBLEM, risk=0.013).quantile == Wary(model, PROBLEM, risk=0.013).quantile
    json.dumps(dict(model.info))


def test_a_single_command_is_allowed_an_error_in_a_thousand() -> None:
    table = {"risks": [0.05, 1e-3, 1e-4, 1e-5], "quantiles": [3.0, 4.0, 5.0, 6.0]}
    for adapted, quantile in ((False, 4.0), (True, 5.0)):
        model = replace(kl.nominal_unicycle(0.1), info={"noise_quantiles": table})
        noise = ModelNoise(model, PROBLEM, MarginOptions(), adapted)
        assert noise.step_quantile == pytest.approx(quantile, rel=1e-6)
