"""Where OSQP answers, other solvers agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from osqp_box import EXACT
from scipy import sparse

import kmpc_lite as kl
from kmpc_lite.control.nmpc import choose_solver
from kmpc_lite.control.nmpc.osqp_workspace import OSQPWorkspace
from kmpc_lite.control.nmpc.qp_solvers import QPSolution, QPStatus


def agrees_with(
    solver: str,
    p: np.ndarray,
    q: np.ndarray,
    a: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    x: np.ndarray,
) -> None:
    """Another solver's optimum costs the same, and is the same where that is strictly convex."""
    equal = lower == upper
    rows = [(a[~equal & np.isfinite(upper)], upper[~equal & np.isfinite(upper)])]
    rows += [(-a[~equal & np.isfinite(lower)], -lower[~equal & np.isfinite(lower)])]
    g, h = np.vstack([r[0] for r in rows]), np.concatenate([r[1] for r in rows])
    other = qpsolvers.solve_qp(
        sparse.csc_matrix(p),
        q,
        sparse.csc_matrix(g),
        h,
        sparse.csc_matrix(a[equal]) if equal.any() else None,
        lower[equal] if equal.any() else None,
        solver=solver,
        **({"eps_abs": 1e-9} if solver == "proxqp" else {}),  # whose default is 1e-3
    )
    assert other is not None

    def cost(v: np.ndarray) -> float:
        return float(0.5 * v @ p @ v + q @ v)

    assert cost(x) == pytest.approx(cost(other), rel=1e-5, abs=1e-5)
    np.testing.assert_allclose(a @ x, np.clip(a @ x, lower, upper), atol=1e-5)
    if np.linalg.eigvalsh(p).min() > 1e-3:
        np.testing.assert_allclose(x, other, atol=1e-4)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_agrees_with_clarabel_on_random_problems(seed: int) -> None:
    random = np.random.default_rng(seed)
    n, m = int(random.integers(1, 12)), int(random.integers(1, 15))
    root = random.normal(size=(n, n))
    p, a = root @ root.T + 0.05 * np.eye(n), random.normal(size=(m, n))
    middle = a @ random.normal(size=n)  # some point is feasible
    lower, upper = middle - random.exponential(size=m), middle + random.exponential(size=m)
    equal = random.random(m) < 0.2
    equal[n // 2 :] = False
    lower[equal] = upper[equal] = middle[equal]
    lower[random.random(m) < 0.2] = -np.inf
    lower[equal] = middle[equal]
    q = random.normal(size=n)
    # set up with other numbers first: the second solve is an update, as in the controller
    workspace = OSQPWorkspace(
        sparse.csc_matrix(np.triu(p)),
        np.zeros(n),
        sparse.csc_matrix(np.ones((m, n))),
        np.zeros(m),
        np.ones(m),
        **EXACT,
    )
    answer = workspace.solve(
        q, lower, upper, np.asfortranarray(a).ravel(order="F"), np.zeros(n), np.zeros(m)
    )
    assert answer.status is QPStatus.SOLVED
    agrees_with("clarabel", p, q, a, lower, upper, answer.x)


def recorded_qps(
    monkeypatch: pytest.MonkeyPatch, model: kl.KoopmanModel
) -> list[tuple[sparse.csc_matrix, dict[str, np.ndarray]]]:
    """The QPs that a controller meets on a drive past obstacles."""
    recorded: list[tuple[sparse.csc_matrix, dict[str, np.ndarray]]] = []
    names = ("q", "lower", "upper", "Ax", "x", "y")

    class Recorder(OSQPWorkspace):
        def __init__(
            self,
            P: sparse.csc_matrix,
            q: np.ndarray,
            A: sparse.csc_matrix,
            *rest: Any,
            **options: Any,
        ) -> None:
            self.matrices = P, A
            super().__init__(P, q, A, *rest, **options)

        def solve(self, *arguments: np.ndarray, **more: Any) -> QPSolution:
            data = {name: np.array(value) for name, value in zip(names, arguments, strict=True)}
            p, a = self.matrices
            recorded.append(
                (p, {**data, "A": sparse.csc_matrix((data["Ax"], a.indices, a.indptr), a.shape)})
            )
            return super().solve(*arguments, **more)

    monkeypatch.setattr(choose_solver, "OSQPWorkspace", Recorder)
    controller = kl.Controller(model)
    x = np.array([0.0, 0.0, 0.0])
    for k in range(25):
        obstacles = [
            kl.Circle(0.5, 0.5, 0.15),
            kl.Circle(1.2, 0.9, 0.2, -0.1, 0.0),
            kl.Circle(0.2, 1.2, 0.1),
        ]
        plan = controller.step(x, (1.5, 1.5, 0.0) if k < 15 else (-2.0, 0.5, 3.0), obstacles)
        x = model.predict(x, plan.command, np.zeros((model.history, 2)) if model.history else None)
    return recorded


@pytest.mark.parametrize("name", ["nominal", "learned_edmdc", "lagging"])
@pytest.mark.parametrize("solver", ["clarabel", "daqp", "piqp", "proxqp"])
def test_agrees_with_other_solvers_on_the_controllers_problems(
    solver: str, name: str, models: dict[str, kl.KoopmanModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    if solver not in qpsolvers.available_solvers:
        pytest.skip(f"{solver} is not installed")
    recorded = recorded_qps(monkeypatch, models[name])
    assert len(recorded) >= 25
    p, first = recorded[0]
    a = first["A"]
    workspace = OSQPWorkspace(p, first["q"], a, first["lower"], first["upper"], **EXACT)
    full_p = (p + sparse.triu(p, 1).T).toarray()
    for _, data in recorded[::4]:
        answer = workspace.solve(*(data[name] for name in ("q", "lower", "upper", "Ax", "x", "y")))
        assert answer.status is QPStatus.SOLVED
        agrees_with(
            solver, full_p, data["q"], data["A"].toarray(), data["lower"], data["upper"], answer.x
        )
