"""``kmpc bench --solvers``: every QP solver that is installed, on the same recorded states."""

from __future__ import annotations

from kmpc_lite.bench.contenders import Build, Contender
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel


def solver_contenders() -> list[Contender]:
    """Our controller in the paper's formulation, once with each QP solver; OSQP comes first."""
    import qpsolvers

    names = ["osqp", *sorted(set(qpsolvers.available_solvers) - {"osqp"})]
    return [Contender(name, _build(name)) for name in names]


def _build(name: str) -> Build:
    def build(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Controller:
        return Controller(model, problem, guidance=False, tightening=None, solver=name)

    return build
