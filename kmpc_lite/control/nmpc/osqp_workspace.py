"""The only file that touches OSQP: guards what goes in, believes only its status.

OSQP reads raw pointers, keeps old data without a word when a bound crosses, fills the solution of
an infeasible problem with finite garbage and returns NaN for NaN. Here arrays are owned, of the
exact type and length, checked before and after.
"""

from __future__ import annotations

import math
import os
import re
import signal
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import osqp
import scipy.sparse as sp

from kmpc_lite.control.nmpc.qp_solvers import INFINITY, LARGEST, QPSolution, QPStatus
from kmpc_lite.control.options import OSQPOptions
from kmpc_lite.types import Array

NO_TIME_LIMIT = 1e10
"""OSQP's own [s]."""
SOLVED = int(osqp.SolverStatus.OSQP_SOLVED)
INTERRUPTED = int(osqp.SolverStatus.OSQP_SIGINT)
DOUBLE = re.compile(r"(?<![\w.])(\d+\.\d*([eE][-+]?\d+)?|\.?\d+[eE][-+]?\d+)(?![\w.])")
"""Literals of double numbers in C."""
EARLY = frozenset(
    int(s)
    for s in (
        osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
        osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
        osqp.SolverStatus.OSQP_TIME_LIMIT_REACHED,
    )
)


def osqp_settings(options: OSQPOptions) -> dict[str, Any]:
    """Options under OSQP's names."""
    return {
        "eps_abs": options.tolerance,
        "eps_rel": options.tolerance,
        "max_iter": options.max_iter,
        "rho": options.rho,
        "alpha": options.alpha,
        "adaptive_rho": int(options.adaptive_rho),
        "adaptive_rho_interval": options.adaptive_rho_interval,
        "scaling": options.scaling,
        "check_termination": options.check_termination,
    }


class OSQPWorkspace:
    """One QP, ``min x'Px/2 + q'x, l <= Ax <= u``, set up once, solved with new numbers.

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
        for name, given, length in (
            ("q", q, self.n),
            ("lower", lower, self.m),
            ("upper", upper, self.m),
        ):
            if np.shape(given) != (length,):
                raise ValueError(f"{name}: expected shape {(length,)}, got {np.shape(given)}")
        self._setup = (
            sp.csc_matrix(P, copy=True),
            np.array(q, dtype=float),
            sp.csc_matrix(A, copy=True),
            np.array(lower, dtype=float),
            np.array(upper, dtype=float),
        )
        self._settings = settings
        # OSQP rounds in scaling and unscaling QPs, and keeps the rho that it has adapted to one
        self._rounds = bool(settings.get("scaling", 1))
        self._fresh = False
        self._set_up()

    def _set_up(self) -> None:
        """Set OSQP up, as if nothing had been solved before."""
        if self._fresh:
            return
        P, q, A, lower, upper = self._setup
        self._q[:], self._lower[:], self._upper[:] = q, lower, upper
        self._osqp = osqp.OSQP()
        self._osqp.setup(P, self._q, A, self._lower, self._upper, verbose=False, **self._settings)
        # The wrapper copies and renames; its compiled half takes the same arrays and returns error
        # codes.
        self._solver = self._osqp._solver
        self._time_limit, self._rho = self._osqp.settings.time_limit, self._osqp.settings.rho
        self._own_P, self._fresh, self._adapted = True, True, False

    def __reduce__(self) -> tuple[Any, ...]:
        # OSQP's own memory does not copy; nothing in it outlives a step
        return _rebuilt, (type(self), self._setup, self._settings)

    @property
    def can_be_stopped(self) -> bool:
        """Whether `time_limit` has an effect: OSQP's iterates are of use at any time."""
        return True

    def write_code(self, folder: str | os.PathLike[str], float32: bool) -> None:
        """Write OSQP's own embedded code for this QP, whose numbers may change, into a folder.

        All files lie side by side, so that no compiler needs to know of other folders. Its global
        is ``kmpc_solver``; float throughout if `float32`.
        """
        self._set_up()
        with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
            self._osqp.codegen(
                os.fspath(folder),
                parameters="matrices",
                use_float=float32,
                printing_enable=False,
                profiling_enable=False,
                interrupt_enable=False,
                prefix="kmpc_",
                compile=False,
            )
        # the folder that it is copied into has a build of its own
        for name in ("setup.py", "bindings.cpp", "emosqp.c", "Makefile", "CMakeLists.txt"):
            os.unlink(os.path.join(folder, name))
        for part in ("src", "inc/public", "inc/private", "inc"):
            inner = Path(folder, part)
            for file in [path for path in inner.iterdir() if path.is_file()]:
                text = file.read_text()
                # OSQP's own literals are double, and with them what is worked out from them
                text = DOUBLE.sub(r"\g<0>f", text) if float32 else text
                Path(folder, file.name).write_text(text)
                file.unlink()
            inner.rmdir()

    def restart(self) -> None:
        """Have OSQP forget what it has learned from an earlier solve."""
        if self._rounds:
            self._set_up()
        elif self._adapted:
            # the same to the last bit as setting up anew, in a fiftieth of its time
            self._solver.update_rho(self._rho)
            self._adapted = False

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
        """Solve with new numbers from a warm start; see `QPSolver.solve`."""
        shapes = (q.shape, lower.shape, upper.shape, Ax.shape, x.shape, y.shape)
        if shapes != self._shapes:
            raise ValueError(
                f"QP data q, lower, upper, Ax, x, y: expected shapes {self._shapes}, got {shapes}"
            )
        self._q[:], self._Ax[:], self._x[:], self._y[:] = q, Ax, x, y
        np.maximum(lower, -INFINITY, out=self._lower)
        np.minimum(upper, INFINITY, out=self._upper)
        if fault := self._fault():
            return self._failed(fault)
        if not math.isfinite(np.add.reduce(self._start)):
            self._start[:] = 0.0
        if Px is not None or not self._own_P:
            Px = self._cost(Px)
            if Px is None:
                return self._failed(f"QP cost not finite, or beyond {LARGEST:g}")
        self._fresh = False
        self._limit_time(NO_TIME_LIMIT if time_limit is None else time_limit)
        solver = self._solver
        if solver.update_data_vec(
            q=self._q, l=self._lower, u=self._upper
        ) or solver.update_data_mat(P_x=Px, P_i=None, A_x=self._Ax, A_i=None):
            return self._failed("OSQP refused the data")
        # After a matrix update the problem is scaled anew but not the iterates.
        solver.warm_start(self._x, self._y)
        solver.solve()
        info = solver.info
        status = info.status_val
        self._adapted = self._adapted or info.rho_updates > 0
        if status == SOLVED:
            outcome, reason = QPStatus.SOLVED, ""
        elif status in EARLY:
            outcome, reason = QPStatus.STOPPED_EARLY, info.status
        else:
            if status == INTERRUPTED:
                # OSQP catches Ctrl-C while it solves and tells nobody: the program hears it here
                signal.raise_signal(signal.SIGINT)
            return self._failed(f"OSQP: {info.status}")
        solution = solver.solution
        primal, dual = np.array(solution.x), np.array(solution.y)
        if not math.isfinite(np.add.reduce(primal) + np.add.reduce(dual)):
            return self._failed("OSQP: solution not finite")
        return QPSolution(outcome, primal, dual, info.iter, info.prim_res, info.dual_res, reason)

    def _fault(self) -> str:
        """What is wrong with the data that OSQP is about to be given, or nothing."""
        # each of these is also false for NaN
        if not np.maximum.reduce(np.abs(self._numbers)) <= LARGEST:
            return f"QP data not finite, or beyond {LARGEST:g}: the factorisation would break down"
        if not np.logical_and.reduce(self._lower <= self._upper):
            return "QP bounds not finite, or they cross"
        # such a row would cross once its other side is cut to INFINITY, and OSQP would complain on
        # stderr
        if (
            np.maximum.reduce(self._lower) >= INFINITY
            or np.minimum.reduce(self._upper) <= -INFINITY
        ):
            return f"QP bounds that leave nothing below {INFINITY:g}"
        return ""

    def _cost(self, Px: Array | None) -> Array | None:
        """Entries of P for the next solve, those of the setup if not given; None if not finite.

        Raises
        ------
        ValueError
            For a wrong shape.
        """
        own: Array = self._setup[0].data
        self._own_P = Px is None
        if Px is None:
            return own
        if Px.shape != own.shape:
            raise ValueError(f"QP data Px: expected shape {own.shape}, got {Px.shape}")
        # also false for NaN
        if not np.maximum.reduce(np.abs(Px)) <= LARGEST:
            return None
        return np.ascontiguousarray(Px, dtype=float)

    def _limit_time(self, seconds: float) -> None:
        """Have OSQP stop after this long [s]."""
        if seconds != self._time_limit:
            self._time_limit = self._osqp.settings.time_limit = seconds
            self._solver.update_settings(self._osqp.settings)

    def _failed(self, reason: str) -> QPSolution:
        return QPSolution.failed(self.n, self.m, reason)


def _rebuilt(
    kind: type[OSQPWorkspace], setup: tuple[Any, ...], settings: dict[str, Any]
) -> OSQPWorkspace:
    return kind(*setup, **settings)
