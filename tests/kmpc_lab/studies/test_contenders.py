"""One way to say which controller to build, for studies and benchmarks alike."""

from dataclasses import replace

import pytest

import kmpc_lite as kl
from kmpc_lab.studies.contenders import (
    Contender,
)
from kmpc_lite.scenario.files import Scenario


def test_a_study_keeps_the_contenders_margin_and_a_benchmark_the_problems() -> None:
    model, scenario = kl.nominal_unicycle(0.1), replace(Scenario.load("mehrez"), margin=0.3)
    contender = Contender("x", margin=0.07)
    assert contender.build(model, scenario).problem.margin == 0.07
    assert contender.make(model, scenario.problem()).problem.margin == 0.3


def test_what_is_missing_is_reported_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert "pip install 'kmpc-lab[peers]'" in Contender("x", "ipopt").missing
    assert Contender("x").missing == ""
