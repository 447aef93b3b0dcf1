"""The only file that touches OSQP: guards what goes in, believes only its status.

OSQP reads raw pointers, keeps old data without a word when a bound crosses, fills the solution of
an infeasible problem with finite garbage and returns NaN for NaN. Here arrays are owned, of the
exact type and length, checked before and after.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import osqp
import scipy.sparse as sp

from kmpc_lite.types import Array

INFINITY = 1e30
"""Bounds beyond this are open, as OSQP itself has it. A row must not change between open and
closed: that refactorises."""

LARGEST = 1e10
"""Entries of A or q beyond this make OSQP's factorisation fail, loudly and after it has taken over
the new bounds."""


class QPStatus(Enum):
    """What became of a QP."""

    SOLVED = "solved"
    STOPPED_EARLY = "stopped early"
    """Iteration or time limit: the iterate is finite and worth checking."""
    FAILED = "failed"
    """Infeasible, bad data or not finite: there is no iterate."""


@dataclass(frozen=True, eq=False)
class QPSolution:
    """An iterate with its status; `x` and `y` are copies."""

    status: QPStatus
    x: Array
    y: Array
    iterations: int
    primal_residual: float
    dual_residual: float
    reason: str


class OSQPWorkspace:
    """One QP, ``min x'Px/2 + q'x, l <= Ax <= u``, set up once and solved many times with new numbers.

    Parameters
    ----------
    P, A : scipy.sparse.csc_matrix
        Upper triangle of P (n, n), and A (m, n); entries that may become nonzero are stored from
        the start.
    q, lower, upper : ndarray
        (n,), (m,), (m,).
    settings
        OSQP's own.
    """

    def __init__(
        self,
        P: sp.csc_matrix,
        q: Array,
        A: sp.csc_matrix,
        lower: Array,
        upper: Array,
        **settings: Any,
    ) -> None:
        self.n, self.m, self.nnz = A.shape[1], A.shape[0], A.nnz
        self._Px, self._new_Px = np.zeros(P.nnz), False
        # what is checked together lies together
        self._numbers, self._start = np.zeros(self.n + self.nnz), np.zeros(self.n + self.m)
        self._q, self._Ax = self._numbers[: self.n], self._numbers[self.n :]
        self._x, self._y = self._start[: self.n], self._start[self.n :]
        self._lower, self._upper = np.zeros(self.m), np.zeros(self.m)
        self._shapes = (
            self._q.shape,
            self._lower.shape,
            self._upper.shape,
            self._Ax.shape,
            self._x.shape,
            self._y.shape,
        )
        for name, own, given in (
            ("q", self._q, q),
            ("lower", self._lower, lower),
            ("upper", self._upper, upper),
        ):
            if np.shape(given) != own.shape:
                raise ValueError(f"{name}: expected shape {own.shape}, got {np.shape(given)}")
            own[:] = given
        self._osqp = osqp.OSQP()
        self._osqp.setup(
            sp.csc_matrix(P),
            self._q,
            sp.csc_matrix(A),
            self._lower,
            self._upper,
            verbose=False,
            **settings,
        )
        # The wrapper copies and renames; its compiled half takes the same arrays and returns error
        # codes.
        self._solver = self._osqp._solver

    def limit_time(self, seconds: float) -> None:
        """Stop later solves after this long [s]; what there is by then comes back as STOPPED_EARLY."""
        self._osqp.settings.time_limit = seconds
        self._solver.update_settings(self._osqp.settings)

    def change_cost(self, Px: Array) -> None:
        """Solve with another P from the next call on: all its stored entries, in CSC order.

        Raises
        ------
        ValueError
            For a wrong shape.
        """
        if Px.shape != self._Px.shape:
            raise ValueError(f"QP data P: expected shape {self._Px.shape}, got {Px.shape}")
        self._Px[:], self._new_Px = Px, True

    def solve(
        self, q: Array, lower: Array, upper: Array, Ax: Array, x: Array, y: Array
    ) -> QPSolution:
        """Solve with new numbers from a warm start.

        Parameters
        ----------
        q, lower, upper : ndarray
            (n,), (m,), (m,).
        Ax : ndarray
            All stored entries of A, in CSC order, (nnz,).
        x, y : ndarray
            Warm start (n,), (m,); one that is not finite is replaced by zeros.

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        shapes = (q.shape, lower.shape, upper.shape, Ax.shape, x.shape, y.shape)
        if shapes != self._shapes:
            raise ValueError(
                f"QP data q, lower, upper, Ax, x, y: expected shapes {self._shapes}, got {shapes}"
            )
        self._q[:], self._Ax[:], self._x[:], self._y[:] = q, Ax, x, y
        np.maximum(lower, -INFINITY, out=self._lower)
        np.minimum(upper, INFINITY, out=self._upper)
        # each of these is also false for NaN
        if not np.maximum.reduce(np.abs(self._numbers)) <= LARGEST:
            return self._failed(
                f"QP data not finite, or beyond {LARGEST:g}: the factorisation would break down"
            )
        if self._new_Px and not np.maximum.reduce(np.abs(self._Px)) <= LARGEST:
            return self._failed(f"QP cost not finite, or beyond {LARGEST:g}")
        if not np.logical_and.reduce(self._lower <= self._upper):
            return self._failed("QP bounds not finite, or they cross")
        # such a row would cross once its other side is cut to INFINITY, and OSQP would complain on
        # stderr
        if (
            np.maximum.reduce(self._lower) >= INFINITY
            or np.minimum.reduce(self._upper) <= -INFINITY
        ):
            return self._failed(f"QP bounds that leave nothing below {INFINITY:g}")
        if not math.isfinite(np.add.reduce(self._start)):
            self._start[:] = 0.0
        solver = self._solver
        if solver.update_data_vec(
            q=self._q, l=self._lower, u=self._upper
        ) or solver.update_data_mat(
            P_x=self._Px if self._new_Px else None, P_i=None, A_x=self._Ax, A_i=None
        ):
            return self._failed("OSQP refused the data")
        self._new_Px = False
        # After a matrix update the problem is scaled anew but not the iterates.
        solver.warm_start(self._x, self._y)
        solver.solve()
        info = solver.info
        status = info.status_val
        if status == SOLVED:
            outcome, reason = QPStatus.SOLVED, ""
        elif status in EARLY:
            outcome, reason = QPStatus.STOPPED_EARLY, info.status
        else:
            return self._failed(f"OSQP: {info.status}")
        solution = solver.solution
        primal, dual = np.array(solution.x), np.array(solution.y)
        if not math.isfinite(np.add.reduce(primal) + np.add.reduce(dual)):
            return self._failed("OSQP: solution not finite")
        return QPSolution(outcome, primal, dual, info.iter, info.prim_res, info.dual_res, reason)

    def _failed(self, reason: str) -> QPSolution:
        return QPSolution(
            QPStatus.FAILED, np.zeros(self.n), np.zeros(self.m), 0, np.inf, np.inf, reason
        )


SOLVED = int(osqp.SolverStatus.OSQP_SOLVED)
EARLY = frozenset(
    int(s)
    for s in (
        osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
        osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
        osqp.SolverStatus.OSQP_TIME_LIMIT_REACHED,
    )
)
