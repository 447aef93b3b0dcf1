"""The solver that acados generates for a problem: costs, constraints, options, and its build."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.peers.ipopt import symbolic_step
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES


def build_solver(
    model: KoopmanModel, problem: NavigationProblem, obstacles: int, folder: Path
) -> Any:
    """Generate, compile and load the solver in a folder, with room for a number of circles."""
    from acados.acados_template import AcadosOcp, AcadosOcpSolver  # type: ignore[import-not-found]

    ocp = AcadosOcp()
    ocp.model, ocp.dims.N = _acados_model(model, problem, obstacles), problem.horizon
    # the folder is that of one controller: no other may load its library. In C the name may hold
    # letters and digits, and no underscore at its end
    ocp.model.name = "kmpc_" + "".join(c if c.isalnum() else "0" for c in folder.name)
    ocp.parameter_values = np.zeros(3 * obstacles)
    _set_cost(ocp, problem)
    _set_bounds(ocp, problem)
    _set_soft_obstacles(ocp, problem, obstacles)
    _set_options(ocp, problem)
    ocp.code_export_directory = str(folder / "code")
    here = os.getcwd()
    try:
        os.chdir(folder)
        with contextlib.redirect_stdout(io.StringIO()), _quiet_file_descriptors():
            return AcadosOcpSolver(ocp, json_file=str(folder / "ocp.json"))
    finally:
        os.chdir(here)


def _acados_model(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Any:
    """Dynamics, and the clearance of every circle (x, y, radius) given as a parameter."""
    import casadi as ca
    from acados.acados_template import AcadosModel

    x, u, p = ca.SX.sym("x", STATES), ca.SX.sym("u", INPUTS), ca.SX.sym("p", 3 * obstacles)
    clearances = [
        ca.sqrt(ca.sumsqr(x[:2] - p[3 * i : 3 * i + 2]))
        - p[3 * i + 2]
        - problem.robot_radius
        - problem.margin
        for i in range(obstacles)
    ]
    described = AcadosModel()
    described.x, described.u, described.p = x, u, p
    described.disc_dyn_expr = symbolic_step(model)(x, u)
    described.con_h_expr = described.con_h_expr_e = ca.vertcat(*clearances)
    return described


def _set_cost(ocp: Any, problem: NavigationProblem) -> None:
    q, r, q_terminal = problem.weights
    ocp.cost.cost_type = ocp.cost.cost_type_e = "LINEAR_LS"
    # acados halves squares, and weighs a stage, but not the end, by its length in seconds
    ocp.cost.W = 2 / problem.dt * np.block([[q, np.zeros((3, 2))], [np.zeros((2, 3)), r]])
    ocp.cost.W_e = 2 * q_terminal
    ocp.cost.Vx, ocp.cost.Vu, ocp.cost.Vx_e = np.eye(5, 3), np.eye(5, 2, -3), np.eye(3)
    ocp.cost.yref, ocp.cost.yref_e = np.zeros(5), np.zeros(3)


def _set_bounds(ocp: Any, problem: NavigationProblem) -> None:
    u_min, u_max, x_min, x_max = problem.bounds
    bounds = ocp.constraints
    bounds.lbu, bounds.ubu, bounds.idxbu = u_min, u_max, np.arange(2)
    bounds.lbx, bounds.ubx, bounds.idxbx = x_min[:2], x_max[:2], np.arange(2)
    bounds.x0 = np.zeros(3)


def _set_soft_obstacles(ocp: Any, problem: NavigationProblem, obstacles: int) -> None:
    linear, quadratic = problem.slack_weights
    for end, scale in (("", 1 / problem.dt), ("_e", 1.0)):
        setattr(ocp.constraints, f"lh{end}", np.zeros(obstacles))
        setattr(ocp.constraints, f"uh{end}", np.full(obstacles, 1e6))
        setattr(ocp.constraints, f"idxsh{end}", np.arange(obstacles))
        for weight, value in (("zl", linear), ("zu", 0.0), ("Zl", 2 * quadratic), ("Zu", 0.0)):
            setattr(ocp.cost, f"{weight}{end}", np.full(obstacles, scale * value))


def _set_options(ocp: Any, problem: NavigationProblem) -> None:
    options = ocp.solver_options
    options.tf = problem.horizon * problem.dt
    options.integrator_type, options.hessian_approx = "DISCRETE", "GAUSS_NEWTON"
    options.nlp_solver_type, options.qp_solver = "SQP_RTI", "PARTIAL_CONDENSING_HPIPM"
    options.print_level = 0
    # HPIPM at its best here: with the default tolerance of 1e-6 it always ran to its limit of
    # 50 iterations, ten times as long
    options.hpipm_mode, options.qp_solver_cond_N = "SPEED", max(1, problem.horizon // 4)
    options.qp_solver_tol_stat = options.qp_solver_tol_eq = options.qp_solver_tol_ineq = (
        options.qp_solver_tol_comp
    ) = 1e-4


@contextlib.contextmanager
def _quiet_file_descriptors() -> Any:
    """Keep the compiler's and the template engine's words off the terminal."""
    sys.stdout.flush()
    saved = [os.dup(1), os.dup(2)]
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
        os.dup2(nothing.fileno(), 2)
        try:
            yield
        finally:
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
