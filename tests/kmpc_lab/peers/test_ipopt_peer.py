"""The CasADi peer solves the same problem.

The same predictions, constraints kept, the same promises of `step`.
"""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.bench.drives import TUNING_SEED, RecordedDrive, learned_model, record
from kmpc_lab.bench.quality import EQUAL, OBEYED, VERDICTS, compare, format_comparison
from kmpc_lab.peers.ipopt import IpoptController, symbolic_step
from kmpc_lite.control.problem import NavigationProblem

DT = 0.1
GOAL = (1.5, 1.5, 0.0)
CIRCLES = [kl.Circle(0.6, 0.6, 0.15), kl.Circle(1.35, 0.45, 0.12, 0.0, 0.05)]
DICTIONARIES = {
    "unicycle": kl.UnicycleDictionary(),
    "trig": kl.HermiteTrigDictionary(order=0),
    "two harmonics": kl.HermiteTrigDictionary(order=0, harmonics=2),
    "hermite 1": kl.HermiteTrigDictionary(order=1),
    "hermite 2": kl.HermiteTrigDictionary(order=2),
}


def random_model(dictionary: kl.Dictionary, continuous: bool) -> kl.KoopmanModel:
    """No sensible robot, but every matrix entry counts."""
    random = np.random.default_rng(3)
    nz = dictionary.size
    rows = 3 if continuous else nz
    shapes = ((rows, nz), (rows, 2), (rows, 2 * nz))
    a, b, h = (random.normal(size=shape) / nz for shape in shapes)
    return kl.KoopmanModel(
        dictionary,
        DT,
        a,
        b,
        h,
        np.eye(3) if continuous else random.normal(size=(3, nz)),
        continuous,
    )


@pytest.mark.parametrize("name", DICTIONARIES)
@pytest.mark.parametrize("kind", ["continuous", "continuous, midpoint", "discrete"])
def test_symbolic_step_is_predict(name: str, kind: str) -> None:
    model = random_model(DICTIONARIES[name], kind != "discrete")
    if kind.endswith("midpoint"):
        model = kl.KoopmanModel(
            model.dictionary, DT, model.A, model.B, model.H, model.C, True, integrator="midpoint"
        )
    step, random = symbolic_step(model), np.random.default_rng(0)
    for _ in range(10):
        x, u = random.normal(size=3) * (2, 2, 4), random.normal(size=2)
        np.testing.assert_allclose(
            np.array(step(x, u)).ravel(), model.predict(x, u), rtol=1e-10, atol=1e-10
        )


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
def test_plans_keep_every_constraint(solver: str) -> None:
    problem = kl.NavigationProblem(margin=0.02)
    controller = IpoptController(kl.nominal_unicycle(DT), problem, solver=solver)
    x = np.array([0.0, 0.0, 0.3])
    for k in range(12):
        circles = [kl.Circle(c.x + k * DT * c.vx, c.y + k * DT * c.vy, *c[2:]) for c in CIRCLES]
        plan = controller.step(x, GOAL, circles)
        assert plan.status is kl.PlanStatus.SOLVED
        u_min, u_max, x_min, x_max = problem.bounds
        np.testing.assert_allclose(plan.states[0], x, atol=1e-6)
        np.testing.assert_allclose(
            controller.model.predict(plan.states[:-1], plan.inputs), plan.states[1:], atol=1e-5
        )
        assert (plan.inputs <= u_max + 1e-6).all() and (plan.inputs >= u_min - 1e-6).all()
        assert (plan.states[1:] <= x_max + 1e-6).all() and (plan.states[1:] >= x_min - 1e-6).all()
        times = DT * np.arange(1, 21)
        for c in circles:
            gaps = (
                np.hypot(
                    plan.states[1:, 0] - c.x - c.vx * times, plan.states[1:, 1] - c.y - c.vy * times
                )
                - c.radius
                - 0.15
            )
            assert gaps.min() > 0.02 - 1e-5
        assert plan.clearance > 0.0
        assert (plan.command <= u_max).all() and (plan.command >= u_min).all()
        x = controller.model.predict(x, plan.command)
    assert x[0] > 0.2


def test_an_impossible_problem_is_reported_and_the_command_still_bounded() -> None:
    problem = kl.NavigationProblem()
    # the robot stands deep in an obstacle that it cannot leave within one period, and nothing is
    # soft here
    plan = IpoptController(kl.nominal_unicycle(DT), problem).step(
        (0.0, 0.0, 0.0), GOAL, [kl.Circle(0.0, 0.0, 5.0)]
    )
    assert plan.status is kl.PlanStatus.FALLBACK
    assert plan.reason
    assert np.isfinite(plan.command).all()
    assert (np.abs(plan.command) <= problem.bounds[1]).all()


def test_changes_of_commands_are_limited_from_the_one_sent_last() -> None:
    problem = kl.NavigationProblem(du_max=(1.0, 3.0))
    controller, x, before = (
        IpoptController(kl.nominal_unicycle(DT), problem),
        np.array([0.0, 0.0, 0.3]),
        np.zeros(2),
    )
    for _ in range(12):
        plan = controller.step(x, GOAL, CIRCLES[:1])
        assert plan.status is kl.PlanStatus.SOLVED
        assert (
            np.abs(np.diff(np.vstack([before, plan.inputs]), axis=0)) <= DT * problem.du_max + 1e-6
        ).all()
        assert (np.abs(plan.command - before) <= DT * problem.du_max + 1e-12).all()
        before, x = plan.command, controller.model.predict(x, plan.command)
    assert before[0] > 0.3
    with pytest.raises(kl.ProblemError, match="du_max"):
        IpoptController(kl.nominal_unicycle(DT), problem, solver="fatrop")


pytest.importorskip("casadi", reason="the extra peers is not installed")


def test_ours_converges_to_what_ipopt_finds() -> None:
    model, problem = learned_model(), NavigationProblem()
    drives = record(model, problem, 2, TUNING_SEED + 50, 12)
    rows = compare(model, problem, drives)
    assert len(rows) == 24
    assert all(
        row.verdict == "as good" and row.excess <= EQUAL and row.violation <= OBEYED for row in rows
    )
    assert "as good on 24 of the 24 states" in format_comparison(rows)


def test_a_start_in_an_obstacle_is_distinguished() -> None:
    model, problem = learned_model(), NavigationProblem()
    inside = RecordedDrive(
        np.array([[0.3, 0.0, 3.5]]),
        np.array([1.5, 0.0, 0.0]),
        np.array([[0.0, 0.0, 0.2, 0.0, 0.0]]),
    )
    (row,) = compare(model, problem, [inside])
    assert row.verdict == "starts inside" and row.verdict in VERDICTS
    assert "states on which IPOPT" not in format_comparison([row])
