"""Any QP solver that qpsolvers knows and has installed, for the same QP.

qpsolvers sets each problem up anew, so that nothing but the warm start passes from solve to solve.
"""

from __future__ import annotations

from typing import Any, NamedTuple

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


class _Split(NamedTuple):
    """The rows as qpsolvers wants them, ``G x <= h`` and ``E x = b``."""

    equal: Array
    above: Array
    below: Array
    """Numbers of the rows that are equalities, and that have an upper and a lower bound."""
    G: sp.csc_matrix
    G_from: Array
    E: sp.csc_matrix
    E_from: Array
    """Matrices, and where their entries stand in those of A."""
    G_sign: Array
    """Minus one for lower bounds."""


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
        # entries by their numbers, from one on: so a change of form tells where each has gone
        self._numbered = _numbered(A).tocsr()
        upper = _numbered(P)
        self._P = sp.csc_matrix(upper + sp.triu(upper, 1).T, dtype=float)
        self._P_from = self._P.data.astype(int) - 1
        weight = REGULARISATION if name in POSITIVE_DEFINITE_ONLY else 0.0
        self._regularisation = sp.csc_matrix(weight * sp.eye(self.n))
        self._dense = name not in qpsolvers.sparse_solvers
        self._split: tuple[bytes, _Split] | None = None

    def _solve(self, data: QPData, time_limit: float | None) -> QPSolution:
        import qpsolvers

        q, lower, upper, Ax, x, _, Px = data
        assert Px is not None
        split = self._split_rows(lower, upper)
        split.G.data[:] = split.G_sign * Ax[split.G_from]
        split.E.data[:] = Ax[split.E_from]
        self._P.data[:] = Px[self._P_from]
        problem = qpsolvers.Problem(
            self._in_form(self._P + self._regularisation),
            q,
            self._in_form(split.G),
            np.concatenate([upper[split.above], -lower[split.below]]),
            self._in_form(split.E) if len(split.equal) else None,
            upper[split.equal] if len(split.equal) else None,
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
        return self._solution(found, split)

    def _in_form(self, matrix: sp.csc_matrix) -> Any:
        """A matrix as the solver takes it: sparse, or dense."""
        return matrix.toarray() if self._dense else matrix

    def _solution(self, found: Any, split: _Split) -> QPSolution:
        """The answer of qpsolvers in our form."""
        duals = np.zeros(self.m)
        count = len(split.above)
        if found.z is not None and len(found.z):
            duals[split.above] += found.z[:count]
            duals[split.below] -= found.z[count:]
        if found.y is not None and len(found.y):
            duals[split.equal] = found.y
        if not np.isfinite(duals).all():
            return self._failed(f"{self.name}: multipliers not finite")
        if found.found:
            return QPSolution(QPStatus.SOLVED, np.array(found.x), duals, 0, *2 * (self.tolerance,))
        left = float(found.primal_residual()), float(found.dual_residual())
        why = f"{self.name}: not solved to its tolerance"
        return QPSolution(QPStatus.STOPPED_EARLY, np.array(found.x), duals, 0, *left, why)

    def _split_rows(self, lower: Array, upper: Array) -> _Split:
        """Part the rows by their bounds; known again while the same rows are bounded."""
        equal = lower == upper
        above, below = (upper < INFINITY) & ~equal, (lower > -INFINITY) & ~equal
        key = np.concatenate([equal, above, below]).tobytes()
        if self._split is None or self._split[0] != key:
            equal, above, below = (np.flatnonzero(mask) for mask in (equal, above, below))
            E = sp.csc_matrix(self._numbered[equal])
            G = sp.vstack([self._numbered[above], -self._numbered[below]], format="csc")
            split = _Split(
                equal,
                above,
                below,
                sp.csc_matrix(G, dtype=float),
                np.abs(G.data) - 1,
                sp.csc_matrix(E, dtype=float),
                E.data - 1,
                np.sign(G.data).astype(float),
            )
            self._split = key, split
        return self._split[1]


def _numbered(matrix: sp.csc_matrix) -> sp.csc_matrix:
    """The same entries, numbered from one on."""
    numbers = np.arange(1, matrix.nnz + 1)
    return sp.csc_matrix((numbers, matrix.indices, matrix.indptr), matrix.shape)
