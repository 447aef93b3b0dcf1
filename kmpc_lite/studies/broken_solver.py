"""OSQP with a switch that makes it fail: for drives with forced failures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import osqp

from kmpc_lite.control.nmpc.osqp_workspace import SOLVED
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
GARBAGE = 2.14e9
"""What OSQP leaves in the solution of a problem that it could not solve."""
CUT_SHORT = 1e-3
"""How far an iterate that was stopped early is from the solution, as a share of its values and as a
number."""


class BrokenSolver:
    """OSQP's compiled half with a switch.

    While `fault` names a status, solves end with it; ``update refused`` refuses data.
    """

    def __init__(self, solver: Any, random: np.random.Generator) -> None:
        self._solver, self._random = solver, random
        self.fault = ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def update_data_vec(self, **data: Any) -> int:
        """Take new vectors, or refuse them as OSQP refuses bounds that cross.

        It then returns an error code, and everything stays as it was.
        """
        return 1 if self.fault == "update refused" else int(self._solver.update_data_vec(**data))

    @property
    def info(self) -> Any:
        """OSQP's account of the last solve."""
        return (
            _Told(self._solver.info, int(STATUSES[self.fault]), self.fault)
            if self.fault in STATUSES
            else self._solver.info
        )

    @property
    def solution(self) -> Any:
        """OSQP's solution, moved away from the optimum where the solve was cut short.

        After a failed solve it is what OSQP leaves there.
        """
        found = self._solver.solution
        if self.fault not in STATUSES or int(STATUSES[self.fault]) == SOLVED:
            return found
        if self.fault in ("solved inaccurate", "max iter", "time limit"):
            off = CUT_SHORT * self._random.normal(size=len(found.x))
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
