"""A QP solver that fails by a switch, as OSQP does: for drives that must survive it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import osqp

from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import SOLVED, OSQPWorkspace, osqp_settings
from kmpc_lite.control.options import OSQPOptions
from kmpc_lite.types import Array

STATUSES = {
    "solved inaccurate": osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
    "primal infeasible": osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE,
    "primal infeasible inaccurate": osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE,
    "dual infeasible": osqp.SolverStatus.OSQP_DUAL_INFEASIBLE,
    "dual infeasible inaccurate": osqp.SolverStatus.OSQP_DUAL_INFEASIBLE_INACCURATE,
    "max iter": osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
    "time limit": osqp.SolverStatus.OSQP_TIME_LIMIT_REACHED,
    "non-convex": osqp.SolverStatus.OSQP_NON_CVX,
    "unsolved": osqp.SolverStatus.OSQP_UNSOLVED,
}
GARBAGE = 2.14e9  # what OSQP leaves in the solution of a problem that it could not solve
CUT_SHORT = 1e-3
"""How far an iterate that was stopped early is from the solution, as a share of its values and as a
number."""


@dataclass
class Switch:
    """Which fault solves have, and the chance in it.

    While `fault` names a status, solves end with it; ``update refused`` refuses data.
    """

    random: np.random.Generator
    fault: str = ""


class BrokenWorkspace(OSQPWorkspace):
    """OSQP as controllers use it, on a compiled half with a switch."""

    def __init__(self, switch: Switch, qp: NavigationQP, options: OSQPOptions) -> None:
        self._made_of = switch, qp, options
        super().__init__(qp.P, qp.q, qp.A, qp.lower, qp.upper, **osqp_settings(options))

    def _set_up(self) -> None:
        super()._set_up()
        if not isinstance(self._solver, BrokenSolver):
            self._solver = BrokenSolver(self._solver, self._made_of[0])

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._made_of


class BrokenSolver:
    """OSQP's compiled half with a switch."""

    def __init__(self, solver: Any, switch: Switch) -> None:
        self._solver, self._switch = solver, switch

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def update_data_vec(self, **data: Any) -> int:
        """Take new vectors, or refuse them as OSQP refuses bounds that cross.

        It then returns an error code, and everything stays as it was.
        """
        refused = self._switch.fault == "update refused"
        return 1 if refused else int(self._solver.update_data_vec(**data))

    @property
    def info(self) -> Any:
        """OSQP's account of the last solve."""
        info, fault = self._solver.info, self._switch.fault
        return _Told(info, int(STATUSES[fault]), fault) if fault in STATUSES else info

    @property
    def solution(self) -> Any:
        """OSQP's solution, moved away from the optimum where the solve was cut short.

        After a failed solve it is what OSQP leaves there.
        """
        found, fault = self._solver.solution, self._switch.fault
        if fault not in STATUSES or int(STATUSES[fault]) == SOLVED:
            return found
        if fault in ("solved inaccurate", "max iter", "time limit"):
            off = CUT_SHORT * self._switch.random.normal(size=len(found.x))
            return _Solution(np.array(found.x) * (1.0 + off) + off, np.array(found.y))
        return _Solution(np.full(len(found.x), GARBAGE), np.full(len(found.y), GARBAGE))


@dataclass
class _Solution:
    x: Array
    y: Array


class _Told:
    """OSQP's info with another status."""

    def __init__(self, info: Any, status_val: int, status: str) -> None:
        self._info, self.status_val, self.status = info, status_val, f"{status} (injected)"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._info, name)
