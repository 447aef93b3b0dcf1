"""The only file that touches OSQP: guards what goes in, believes only its status.

OSQP reads raw pointers, keeps old data without a word when a bound crosses, fills the solution of
an infeasible problem with finite garbage and returns NaN for NaN. What goes in and what comes out
is checked.
"""

from __future__ import annotations

import math
import os
import re
import signal
from contextlib import redirect_stdout
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import osqp
import scipy.sparse as sp

from kmpc_lite.control.nmpc.qp_solvers import INFINITY, QPData, QPSolution, QPSolver, QPStatus
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
    settings = asdict(options)
    tolerance = settings.pop("tolerance")
    adapts = int(options.adaptive_rho)
    return {**settings, "eps_abs": tolerance, "eps_rel": tolerance, "adaptive_rho": adapts}


class OSQPWorkspace(QPSolver):
    """One QP, set up once, solved with new numbers; OSQP's iterates are of use at any time.

    `P`, `A`: as `QPSolver` has them. `q`, `lower`, `upper`: (n,), (m,), (m,). `settings`: OSQP's
    own.
    """

    can_be_stopped = True

    def __init__(
        self,
        P: sp.csc_matrix,
        q: Array,
        A: sp.csc_matrix,
        lower: Array,
        upper: Array,
        **settings: Any,
    ) -> None:
        super().__init__(P, A)
        parts = P.copy(), np.array(q), A.copy(), np.array(lower), np.array(upper)
        self._setup, self._settings = parts, settings
        self._checked(QPData(q, lower, upper, A.data, np.zeros(self.n), np.zeros(self.m)))
        # OSQP rounds in scaling and unscaling QPs, and keeps the rho that it has adapted to one
        self._rounds = bool(settings.get("scaling", 1))
        self._fresh = False
        self._set_up()

    def _set_up(self) -> None:
        """Set OSQP up, as if nothing had been solved before."""
        if self._fresh:
            return
        self._osqp = osqp.OSQP()
        self._osqp.setup(*self._setup, verbose=False, **self._settings)
        # The wrapper copies and renames; its compiled half takes the same arrays and returns error
        # codes.
        self._solver = self._osqp._solver
        self._time_limit, self._rho = self._osqp.settings.time_limit, self._osqp.settings.rho
        self._fresh, self._adapted = True, False

    def __reduce__(self) -> tuple[Any, ...]:
        # OSQP's own memory does not copy; nothing in it outlives a step
        return _rebuilt, (type(self), self._setup, self._settings)

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

    def _solve(self, data: QPData, time_limit: float | None) -> QPSolution:
        q, lower, upper, Ax, x, y, Px = data
        if not math.isfinite(np.add.reduce(x) + np.add.reduce(y)):
            x, y = np.zeros(self.n), np.zeros(self.m)
        lower, upper = np.maximum(lower, -INFINITY), np.minimum(upper, INFINITY)
        self._fresh, solver = False, self._solver
        limit = NO_TIME_LIMIT if time_limit is None else time_limit
        if limit != self._time_limit:
            self._time_limit = self._osqp.settings.time_limit = limit
            solver.update_settings(self._osqp.settings)
        refused = solver.update_data_vec(q=q, l=lower, u=upper)
        if refused or solver.update_data_mat(P_x=Px, P_i=None, A_x=Ax, A_i=None):
            return self._failed("OSQP refused the data")
        # After a matrix update the problem is scaled anew but not the iterates.
        solver.warm_start(x, y)
        solver.solve()
        info = solver.info
        self._adapted = self._adapted or info.rho_updates > 0
        if info.status_val not in EARLY and info.status_val != SOLVED:
            if info.status_val == INTERRUPTED:
                # OSQP catches Ctrl-C while it solves and tells nobody: the program hears it here
                signal.raise_signal(signal.SIGINT)
            return self._failed(f"OSQP: {info.status}")
        primal, dual = np.array(solver.solution.x), np.array(solver.solution.y)
        if not math.isfinite(np.add.reduce(primal) + np.add.reduce(dual)):
            return self._failed("OSQP: solution not finite")
        early = info.status_val in EARLY
        status, why = (QPStatus.STOPPED_EARLY, info.status) if early else (QPStatus.SOLVED, "")
        return QPSolution(status, primal, dual, info.iter, info.prim_res, info.dual_res, why)


def _rebuilt(
    kind: type[OSQPWorkspace], setup: tuple[Any, ...], settings: dict[str, Any]
) -> OSQPWorkspace:
    return kind(*setup, **settings)
