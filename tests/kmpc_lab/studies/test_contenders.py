"""One way to say which controller to build, for studies and benchmarks alike."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

import kmpc_lite as kl
from kmpc_lab.studies.contenders import (
    BENCH_CONTENDERS,
    BENCH_FULL_CONTENDERS,
    STUDY_CONTENDERS,
    Contender,
    solver_contenders,
)
from kmpc_lite.scenario.files import Scenario

EVERYONE = (*STUDY_CONTENDERS, *BENCH_CONTENDERS, *BENCH_FULL_CONTENDERS)


def test_a_study_keeps_the_contenders_margin_and_a_benchmark_the_problems() -> None:
    model, scenario = kl.nominal_unicycle(0.1), replace(Scenario.load("mehrez"), margin=0.3)
    contender = Contender("x", margin=0.07)
    assert contender.build(model, scenario).problem.margin == 0.07
    assert contender.make(model, scenario.problem()).problem.margin == 0.3


def test_the_papers_formulation_has_no_guidance() -> None:
    model, scenario = kl.nominal_unicycle(0.1), Scenario.load("mehrez")
    pose, goal, wall = (0.0, 0.0, 0.0), (1.2, 0.0, 0.0), [kl.Wall(0.5, -0.4, 0.5, 0.4)]
    plans = {
        form: Contender("x", form).build(model, scenario).step(pose, goal, wall)
        for form in ("full", "paper")
    }
    # what has no way around the wall plans straight at it
    assert abs(plans["paper"].states[:, 1]).max() < 0.05 < abs(plans["full"].states[:, 1]).max()


def test_every_solver_of_a_contender_is_built_by_its_name() -> None:
    pytest.importorskip("casadi", reason="needs the extra peers")
    from kmpc_lab.peers.ipopt import IpoptController

    model, problem = kl.nominal_unicycle(0.1), kl.NavigationProblem()
    for form in ("ipopt", "fatrop"):
        assert isinstance(Contender("x", form).make(model, problem), IpoptController)
    assert isinstance(Contender("x", "converged").make(model, problem), kl.Controller)


@pytest.mark.parametrize("contender", EVERYONE, ids=lambda c: f"{c.form} {c.label}")
def test_a_contender_can_be_sent_to_another_process(contender: Contender) -> None:
    assert pickle.loads(pickle.dumps(contender)) == contender


def test_each_qp_solver_is_one_contender_and_osqp_the_first() -> None:
    solvers = solver_contenders()
    assert solvers[0].label == "osqp" and len(solvers) == len({c.solver for c in solvers})
    model, problem = kl.nominal_unicycle(0.1), kl.NavigationProblem()
    for contender in solvers:
        plan = contender.make(model, problem).step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        assert plan.command[0] > 0.0, contender


def test_what_is_missing_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert "pip install 'kmpc-lab[peers]'" in Contender("x", "ipopt").missing
    assert Contender("x").missing == ""
