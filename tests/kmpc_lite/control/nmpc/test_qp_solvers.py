"""Every installed QP solver solves the controller's QPs as OSQP does, and drives the robot."""

from typing import Any

import numpy as np
import pytest
import qpsolvers
from scipy import sparse

import kmpc_lite as kl
from kmpc_lite.control.nmpc.qp_solvers import OSQPWorkspace, QPData, QpsolversBackend, QPStatus

SOLVERS = sorted(set(qpsolvers.available_solvers) - {"osqp"})
GOAL = (1.5, 1.5, 0.0)
MAP = [kl.Circle(0.6, 0.6, 0.15), kl.Circle(1.2, 0.4, 0.1)]


def random_qp(seed: int) -> tuple[Any, Any, dict[str, np.ndarray]]:
    """Matrices and numbers of a QP with equalities, one-sided and two-sided rows."""
    random = np.random.default_rng(seed)
    n, m = 8, 9
    root, a = random.normal(size=(n, n)), random.normal(size=(m, n))
    a[random.random((m, n)) < 0.3] = 0.0
    P, A = sparse.csc_matrix(np.triu(root @ root.T + 0.1 * np.eye(n))), sparse.csc_matrix(a)
    middle = a @ random.normal(size=n)
    lower, upper = middle - random.exponential(size=m), middle + random.exponential(size=m)
    upper[:2] = lower[:2] = middle[:2]
    lower[2:4], upper[4:6] = -np.inf, np.inf
    zeros = {"x": np.zeros(n), "y": np.zeros(m)}
    return P, A, {"q": random.normal(size=n), "lower": lower, "upper": upper, "Ax": A.data, **zeros}


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("seed", range(4))
def test_solutions_and_multipliers_are_osqps(name: str, seed: int) -> None:
    P, A, data = random_qp(seed)
    exact = {"eps_abs": 1e-10, "eps_rel": 1e-10, "max_iter": 100_000}
    osqp = OSQPWorkspace(P, data["q"], A, data["lower"], data["upper"], **exact)
    other = QpsolversBackend(name, P, A, 1e-9)
    # twice, the second time with other numbers in the same places
    for scale in (1.0, 1.7):
        told = {**data, "Ax": scale * data["Ax"], "lower": scale * data["lower"]}
        told |= {"upper": scale * data["upper"], "Px": scale * P.data}
        expected, found = osqp.solve(QPData(**told)), other.solve(QPData(**told))
        assert expected.status is found.status is QPStatus.SOLVED, found.reason
        np.testing.assert_allclose(found.x, expected.x, atol=1e-5)
        np.testing.assert_allclose(found.y, expected.y, atol=1e-4)


@pytest.mark.parametrize("name", SOLVERS)
def test_data_that_is_broken_fails_and_leaves_no_trace(name: str) -> None:
    P, A, data = random_qp(1)
    solver = QpsolversBackend(name, P, A, 1e-9)
    first = solver.solve(QPData(**data))
    for field, value in (("q", np.nan), ("Ax", np.inf), ("lower", np.inf), ("upper", np.nan)):
        bad = data[field].copy()
        bad[-1] = value
        answer = solver.solve(QPData(**{**data, field: bad}))
        assert answer.status is QPStatus.FAILED and answer.reason and not answer.x.any()
    crossed = solver.solve(QPData(**{**data, "upper": data["lower"] - 1.0}))
    assert crossed.status is QPStatus.FAILED
    with pytest.raises(ValueError, match="QP data"):
        solver.solve(QPData(**{**data, "q": np.zeros(3)}))
    np.testing.assert_array_equal(solver.solve(QPData(**data)).x, first.x)


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("options", [{}, {"guidance": False, "tightening": None}])
def test_the_robot_arrives_with_any_solver(
    name: str, options: dict[str, Any], learned: kl.KoopmanModel
) -> None:
    controller, reference = (kl.Controller(learned, solver=s, **options) for s in (name, "osqp"))
    x, worst = np.zeros(3), []
    for _ in range(100):
        plan, same = controller.step(x, GOAL, MAP), reference.step(x, GOAL, MAP)
        assert plan.status in (kl.PlanStatus.SOLVED, kl.PlanStatus.FEASIBLE), plan.reason
        worst.append(np.abs(plan.command - same.command).max())
        x = learned.predict(x, plan.command)
    # near enough, as OSQP is stopped early: with margins, which move from pass to pass, less near
    assert np.median(worst) < (0.02 if options else 0.2)
    assert np.hypot(x[0] - GOAL[0], x[1] - GOAL[1]) < 0.15


def test_a_solver_that_is_not_installed_is_refused_with_those_that_are() -> None:
    for name in ("gurobi of my dreams", "", "OSQP"):
        with pytest.raises(kl.ProblemError, match="solver: expected one .*osqp"):
            kl.Controller(kl.nominal_unicycle(0.1), solver=name)


def test_a_budget_is_refused_where_the_solver_cannot_be_stopped() -> None:
    if "daqp" not in SOLVERS:
        pytest.skip("daqp is not installed")
    with pytest.raises(kl.ProblemError, match="time_budget"):
        kl.Controller(kl.nominal_unicycle(0.1), solver="daqp", time_budget=0.05)
