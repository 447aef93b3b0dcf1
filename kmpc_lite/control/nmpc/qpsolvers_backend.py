"""Any QP solver that qpsolvers knows and has installed, for the same QP.

qpsolvers sets each problem up anew, so that nothing but the warm start passes from solve to solve.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from kmpc_lite.control.nmpc.qp_solvers import INFINITY, QPData, QPSolution, QPSolver, QPStatus
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

TOLERANCE_NAMES = {
    "clarabel": ("tol_feas", "tol_gap_abs", "tol_gap_rel"),
    "daqp": ("primal_tol", "dual_tol"),
    "highs": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "piqp": ("eps_abs", "eps_rel"),
    "proxqp": ("eps_abs",),
    "scs": ("eps_abs", "eps_rel"),
}
"""What solvers call their tolerances; others run at their own."""
TIME_LIMIT_NAMES = {"clarabel": "time_limit", "highs": "time_limit", "scs": "time_limit_secs"}
"""What solvers call their time limit [s]; others cannot be stopped."""
POSITIVE_DEFINITE_ONLY = frozenset({"quadprog"})
"""Solvers that take no semidefinite cost."""
REGULARISATION = 1e-8
"""Added to the diagonal of the cost for these."""


class QpsolversBackend(QPSolver):
    """One QP, given to a solver by its name.

    `name`: as qpsolvers calls the solver. `P`, `A`: as `QPSolver` has them. `tolerance`: that
    solutions are found to, as far as the solver can be told. Raises ProblemError for a solver that
    is not installed.
    """

    def __init__(self, name: str, P: sp.csc_matrix, A: sp.csc_matrix, tolerance: float) -> None:
        # here, for it costs as much to import as the rest of the controller
        import qpsolvers

        if name not in qpsolvers.available_solvers:
            known = ", ".join(sorted({"osqp", *qpsolvers.available_solvers}))
            raise ProblemError(
                f"solver: expected one that is installed here ({known}), got {name!r}; "
                "qpsolvers lists more, to be installed with pip"
            )
        super().__init__(P, A)
        self.name, self.tolerance = name, tolerance
        self.can_be_stopped = name in TIME_LIMIT_NAMES
        self._settings = dict.fromkeys(TOLERANCE_NAMES.get(name, ()), tolerance)
        self._upper, self._rows = P.copy(), A.copy()
        self._weight = REGULARISATION if name in POSITIVE_DEFINITE_ONLY else 0.0
        self._dense = name not in qpsolvers.sparse_solvers

    def _solve(self, data: QPData, time_limit: float | None) -> QPSolution:
        import qpsolvers

        q, lower, upper, self._rows.data[:], x, _, self._upper.data[:] = data
        # NumPy and SciPy have the same names for what follows
        form = np if self._dense else sp
        rows, P = (m.toarray() if self._dense else m.tocsr() for m in (self._rows, self._upper))
        equal = lower == upper
        above, below = (upper < INFINITY) & ~equal, (lower > -INFINITY) & ~equal
        problem = qpsolvers.Problem(
            self._in_form(P + form.triu(P, 1).T + self._weight * form.eye(self.n)),
            q,
            self._in_form(form.vstack([rows[above], -rows[below]])),
            np.concatenate([upper[above], -lower[below]]),
            self._in_form(rows[equal]) if equal.any() else None,
            upper[equal] if equal.any() else None,
        )
        settings: dict[str, Any] = dict(self._settings)
        if time_limit is not None and self.can_be_stopped:
            settings[TIME_LIMIT_NAMES[self.name]] = time_limit
        start = x if np.isfinite(x).all() else None
        try:
            found = qpsolvers.solve_problem(problem, self.name, initvals=start, **settings)
        except (qpsolvers.QPError, ValueError, ArithmeticError) as error:
            return self._failed(f"{self.name}: {error}")
        if found.x is None or not np.isfinite(found.x).all():
            return self._failed(f"{self.name}: no solution")
        return self._solution(found, equal, above, below)

    def _in_form(self, matrix: Any) -> Any:
        """A matrix as the solver takes it: sparse, or dense."""
        return matrix if self._dense else sp.csc_matrix(matrix)

    def _solution(self, found: Any, equal: Array, above: Array, below: Array) -> QPSolution:
        """The answer of qpsolvers in our form, from which rows (m,) are which."""
        duals, count = np.zeros(self.m), np.count_nonzero(above)
        if found.z is not None and len(found.z):
            duals[above] += found.z[:count]
            duals[below] -= found.z[count:]
        if found.y is not None and len(found.y):
            duals[equal] = found.y
        if not np.isfinite(duals).all():
            return self._failed(f"{self.name}: multipliers not finite")
        if found.found:
            return QPSolution(QPStatus.SOLVED, np.array(found.x), duals, 0, *2 * (self.tolerance,))
        left = float(found.primal_residual()), float(found.dual_residual())
        why = f"{self.name}: not solved to its tolerance"
        return QPSolution(QPStatus.STOPPED_EARLY, np.array(found.x), duals, 0, *left, why)
