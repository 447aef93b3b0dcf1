"""Which QP solver a name stands for."""

from __future__ import annotations

from collections.abc import Callable

from kmpc_lite.control.nmpc.osqp_workspace import OSQPWorkspace, osqp_settings
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import QPSolver
from kmpc_lite.control.nmpc.qpsolvers_backend import QpsolversBackend
from kmpc_lite.control.options import OSQPOptions

DEFAULT_SOLVER = "osqp"
MakeSolver = Callable[[NavigationQP, OSQPOptions], QPSolver]
"""Sets up a solver for a QP."""


def choose_solver(solver: str | MakeSolver, qp: NavigationQP, options: OSQPOptions) -> QPSolver:
    """Set up a solver for a QP.

    Parameters
    ----------
    solver : str or callable
        ``"osqp"`` for our workspace, a name that qpsolvers knows, or what sets up another one.
    qp : NavigationQP
        Its matrices.
    options : OSQPOptions
        Settings of OSQP; solvers of qpsolvers take the tolerance.

    Raises
    ------
    ProblemError
        For a solver that is not installed.
    """
    if callable(solver):
        return solver(qp, options)
    if solver == DEFAULT_SOLVER:
        return OSQPWorkspace(qp.P, qp.q, qp.A, qp.lower, qp.upper, **osqp_settings(options))
    return QpsolversBackend(solver, qp.P, qp.A, options.tolerance)
