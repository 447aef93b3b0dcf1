"""Which QP solver a name stands for."""

from __future__ import annotations

from kmpc_lite.control.nmpc.osqp_workspace import OSQPWorkspace, osqp_settings
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import QPSolver
from kmpc_lite.control.nmpc.qpsolvers_backend import QpsolversBackend
from kmpc_lite.control.options import OSQPOptions

DEFAULT_SOLVER = "osqp"


def choose_solver(name: str, qp: NavigationQP, options: OSQPOptions) -> QPSolver:
    """Set up a solver for a QP.

    Parameters
    ----------
    name : str
        ``"osqp"`` for our workspace, or a name that qpsolvers knows.
    qp : NavigationQP
        Its matrices.
    options : OSQPOptions
        Settings of OSQP; other solvers take the tolerance.

    Raises
    ------
    ProblemError
        For a solver that is not installed.
    """
    if name == DEFAULT_SOLVER:
        return OSQPWorkspace(qp.P, qp.q, qp.A, qp.lower, qp.upper, **osqp_settings(options))
    return QpsolversBackend(name, qp.P, qp.A, options.tolerance)
