"""Options of the solver, and when passes end."""

from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.nmpc.osqp_workspace import osqp_settings
from kmpc_lite.control.nmpc.sqp import MOST_PASSES, SQP
from kmpc_lite.control.nmpc.trajectory import along, at_rest
from kmpc_lite.control.options import OSQPOptions, SolverOptions
from kmpc_lite.control.task import Task
from kmpc_lite.control.units import with_goal_weights
from kmpc_lite.control.world.surroundings import Surroundings

MODEL = kl.nominal_unicycle(0.1)
PROBLEM = with_goal_weights(kl.NavigationProblem())
GOAL = np.tile((1.5, 1.5, 0.0), (21, 1))
AROUND = Surroundings(np.empty((0, 7)))
TASK = Task(MODEL, np.zeros((0, 2)), np.zeros(2), AROUND, reference=GOAL)


def test_options_of_osqp_reach_it_by_its_names() -> None:
    options = OSQPOptions(1e-5, 77, 0.3, 1.2, True, 35, 4, 15)
    assert osqp_settings(options) == {
        "eps_abs": 1e-5,
        "eps_rel": 1e-5,
        "max_iter": 77,
        "rho": 0.3,
        "alpha": 1.2,
        "adaptive_rho": 1,
        "adaptive_rho_interval": 35,
        "scaling": 4,
        "check_termination": 15,
    }
    for history, most in ((0, 77), (2, 5 * 77)):
        sqp = SQP(PROBLEM, history, options=SolverOptions(options))
        assert sqp.workspace._osqp.settings.max_iter == most  # type: ignore[attr-defined]


def test_a_qp_gets_some_time_even_past_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    sqp = SQP(PROBLEM, 0, clock=lambda: 5.0)
    limits, solve = [], sqp.workspace.solve

    def watched(*data: np.ndarray, time_limit: float | None, **more: Any) -> Any:
        limits.append(time_limit)
        return solve(*data, **more)

    monkeypatch.setattr(sqp.workspace, "solve", watched)
    for deadline in (4.0, 5.2, np.inf):
        sqp.solve(at_rest(sqp.qp, np.zeros(3)), TASK._replace(deadline=deadline))
    np.testing.assert_allclose(limits[0], 5e-5)
    assert limits[1] == pytest.approx(0.2) and limits[-1] is None


def test_another_pass_follows_while_the_model_contradicts_the_plan() -> None:
    sqp = SQP(PROBLEM, 0)
    tolerated = sqp.tolerated
    guess = along(sqp.qp, GOAL, np.array((0.0, 0.0, -2.5)))
    found = sqp.solve(guess, TASK)
    assert 1 < found.passes <= MOST_PASSES and found.defect <= tolerated
    sqp.tolerated = np.inf
    assert sqp.solve(guess, TASK).passes == 1
    sqp.tolerated = 0.0
    assert sqp.solve(guess, TASK).passes == MOST_PASSES


def test_passes_that_go_there_and_back_meet_between() -> None:
    # without it, a plan that turns while it drives swings between two for ever
    problem = with_goal_weights(kl.NavigationProblem(Q_terminal=(20.0, 20.0, 2.0)))
    sqp = SQP(problem, 0, iterations=100, tolerance=1e-6)
    found = sqp.solve(at_rest(sqp.qp, np.array((0.0, 0.0, 0.3))), TASK)
    assert found.step <= 1e-6 and not found.reason
