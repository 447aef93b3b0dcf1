"""Any QP solver that qpsolvers knows and has installed, for the same QP.

qpsolvers sets each problem up anew, so that nothing but the warm start passes from solve to solve.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from kmpc_lite.control.nmpc.qp_solvers import INFINITY, LARGEST, QPSolution, QPStatus
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


class QpsolversBackend:
    """One QP, given to a solver by its name.

    Parameters
    ----------
    name : str
        As qpsolvers calls the solver.
    P, A : scipy.sparse.csc_matrix
        Upper triangle of P (n, n), and A (m, n); entries that may become nonzero are stored from
        the start.
    tolerance : float
        That solutions are found to, as far as the solver can be told.

    Raises
    ------
    ProblemError
        For a solver that is not installed.
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
        self.name, self.tolerance = name, tolerance
        self.m, self.n = A.shape
        self._settings = {key: tolerance for key in TOLERANCE_NAMES.get(name, ())}
        self._entries = A.nnz
        # entries by their numbers, from one on: so a change of form tells where each has gone
        numbers = np.arange(1, A.nnz + 1)
        self._numbered = sp.csc_matrix((numbers, A.indices, A.indptr), A.shape).tocsr()
        self._Px = P.data.copy()
        upper = sp.csc_matrix((np.arange(1, P.nnz + 1), P.indices, P.indptr), P.shape)
        self._P = sp.csc_matrix(upper + sp.triu(upper, 1).T)
        self._P_from = self._P.data - 1
        self._P = sp.csc_matrix(self._P, dtype=float)
        weight = REGULARISATION if name in POSITIVE_DEFINITE_ONLY else 0.0
        self._regularisation = sp.csc_matrix(weight * sp.eye(self.n))
        self._dense = name not in qpsolvers.sparse_solvers
        self._split: tuple[bytes, _Split] | None = None

    def restart(self) -> None:
        """Do nothing: nothing is remembered."""

    @property
    def can_be_stopped(self) -> bool:
        """Whether `time_limit` has an effect."""
        return self.name in TIME_LIMIT_NAMES

    def solve(
        self,
        q: Array,
        lower: Array,
        upper: Array,
        Ax: Array,
        x: Array,
        y: Array,
        *,
        Px: Array | None = None,
        time_limit: float | None = None,
    ) -> QPSolution:
        """Solve with new numbers from a warm start `x`; see `QPSolver.solve`."""
        import qpsolvers

        shapes = [np.shape(part) for part in (q, lower, upper, Ax)]
        expected = [(self.n,), (self.m,), (self.m,), (self._entries,)]
        if shapes != expected:
            raise ValueError(f"QP data q, lower, upper, Ax: expected {expected}, got {shapes}")
        cost = self._Px if Px is None else Px
        if fault := _fault(q, lower, upper, Ax, cost):
            return self._failed(fault)
        split = self._split_rows(lower, upper)
        split.G.data[:] = split.G_sign * Ax[split.G_from]
        split.E.data[:] = Ax[split.E_from]
        self._P.data[:] = cost[self._P_from]
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
        status = QPStatus.SOLVED if found.found else QPStatus.STOPPED_EARLY
        reason = "" if found.found else f"{self.name}: not solved to its tolerance"
        if not np.isfinite(duals).all():
            return self._failed(f"{self.name}: multipliers not finite")
        primal, dual = self.tolerance, self.tolerance
        if found.found is False:
            primal, dual = float(found.primal_residual()), float(found.dual_residual())
        return QPSolution(status, np.array(found.x), duals, 0, primal, dual, reason)

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

    def _failed(self, reason: str) -> QPSolution:
        return QPSolution.failed(self.n, self.m, reason)


def _fault(q: Array, lower: Array, upper: Array, Ax: Array, Px: Array) -> str:
    """What is wrong with the numbers of a QP, or nothing."""
    # each of these is also false for NaN
    if not max(np.abs(part).max(initial=0.0) for part in (q, Ax, Px)) <= LARGEST:
        return f"QP data not finite, or beyond {LARGEST:g}"
    if not (lower <= upper).all():
        return "QP bounds not finite, or they cross"
    if lower.max(initial=0.0) >= INFINITY or upper.min(initial=0.0) <= -INFINITY:
        return f"QP bounds that leave nothing below {INFINITY:g}"
    return ""
