"""What a solver of the QP is asked, and what it answers: OSQP by default, or any other.

What qpsolvers knows and has installed sets each problem up anew, so that nothing but the warm start
passes from solve to solve.

No other file touches OSQP, which reads raw pointers, keeps old data without a word when a bound
crosses, and fills the solution of an infeasible problem with finite garbage: all is checked.
"""

from __future__ import annotations

import math
import os
import re
import signal
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict
from enum import Enum
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import osqp
import scipy.sparse as sp

from kmpc_lite.control.options import OSQPOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.nmpc.qp import NavigationQP

INFINITY = 1e30
"""Bounds beyond this are open, as OSQP itself has it. A row must not change between open and
closed: OSQP would factorise anew."""
LARGEST = 1e10  # entries of P, A or q beyond this make factorisations fail
DEFAULT_SOLVER = "osqp"
plain: Callable[[Any], Array] = partial(np.asarray, dtype=float, order="C")
"""Numbers of any kind as the arrays whose memory solvers read."""
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
POSITIVE_DEFINITE_ONLY = frozenset({"quadprog"})  # solvers that take no semidefinite cost
REGULARISATION = 1e-8  # added to the diagonal of the cost for these


class QPStatus(Enum):
    """What became of a QP."""

    SOLVED = "solved"
    STOPPED_EARLY = "stopped early"
    """Iteration or time limit: the iterate is finite and worth checking."""
    FAILED = "failed"  # infeasible, bad data or not finite: there is no iterate


class QPData(NamedTuple):
    """Numbers of a QP, and where to begin."""

    q: Array  # (n,)
    lower: Array  # (m,)
    upper: Array  # (m,)
    Ax: Array  # all stored entries of A, in CSC order, (nnz,)
    x: Array  # warm start (n,); one that is not finite is replaced by zeros
    y: Array  # its multipliers (m,)
    Px: Array | None = None
    """All stored entries of P, in CSC order; those of the setup if not given."""


class QPSolution(NamedTuple):
    """An iterate with its status; `x` and `y` are copies."""

    status: QPStatus
    x: Array  # (n,)
    y: Array  # (m,) multipliers: positive at an upper bound, negative at a lower one
    iterations: int = 0  # zero if the solver does not tell
    primal_residual: float = np.inf
    dual_residual: float = np.inf
    reason: str = ""


class QPSolver:
    """Solves ``min x'Px/2 + q'x, l <= Ax <= u`` again and again, with new numbers each time.

    A solution depends on the arguments only, not on what was solved before. Solvers copy and
    pickle.

    `P`, `A`: upper triangle of P (n, n), and A (m, n); entries that may become nonzero are stored
    from the start.
    """

    can_be_stopped = False  # whether `time_limit` has an effect

    def __init__(self, P: Any, A: Any) -> None:
        self.m, self.n = A.shape
        self._own_cost: Array = P.data.copy()
        n, m = (self.n,), (self.m,)
        self._shapes = n, m, m, A.data.shape, n, m, P.data.shape

    def restart(self) -> None:
        """Forget what a solver may learn from one solve to the next; called once a step."""

    def solve(self, data: QPData, time_limit: float | None = None) -> QPSolution:
        """Solve with new numbers from a warm start.

        `data`: left alone. `time_limit`: when to stop [s]; what there is by then comes back as
        STOPPED_EARLY. Raises ValueError for wrong shapes.
        """
        told = self._checked(data)
        fault = _fault(told)
        return self._failed(fault) if fault else self._solve(told, time_limit)

    def _checked(self, data: QPData) -> QPData:
        """Give the same as plain arrays of the right lengths: raw pointers to them are read."""
        whole = data if data.Px is not None else data._replace(Px=self._own_cost)
        told = QPData._make(map(plain, whole))
        shapes = tuple(map(attrgetter("shape"), told))
        if shapes != self._shapes:
            names = ", ".join(QPData._fields)
            raise ValueError(f"QP data {names}: expected shapes {self._shapes}, got {shapes}")
        return told

    def _solve(self, data: QPData, time_limit: float | None) -> QPSolution:
        """Solve with numbers that are sound."""
        raise NotImplementedError

    def _failed(self, reason: str) -> QPSolution:
        nothing = np.zeros(self.n), np.zeros(self.m)
        return QPSolution(QPStatus.FAILED, *nothing, reason=reason)


def _fault(data: QPData) -> str:
    """What is wrong with the numbers of a QP, or nothing."""
    q, lower, upper, Ax, _, _, Px = data
    assert Px is not None
    # each of these is also false for NaN
    for part in (q, Ax, Px):
        if not np.maximum.reduce(np.abs(part), initial=0.0) <= LARGEST:
            return f"QP data not finite, or beyond {LARGEST:g}: the factorisation would break down"
    if not np.logical_and.reduce(lower <= upper):
        return "QP bounds not finite, or they cross"
    # such a row would cross once its other side is cut to INFINITY
    low, high = np.maximum.reduce(lower, initial=0.0), np.minimum.reduce(upper, initial=0.0)
    if low >= INFINITY or high <= -INFINITY:
        return f"QP bounds that leave nothing below {INFINITY:g}"
    return ""


MakeSolver = Callable[["NavigationQP", "OSQPOptions"], QPSolver]  # sets up a solver for a QP


def choose_solver(solver: str | MakeSolver, qp: NavigationQP, options: OSQPOptions) -> QPSolver:
    """Set up a solver for a QP.

    `solver`: ``"osqp"`` for our workspace, a name that qpsolvers knows, or what sets up another
    one. `qp`: its matrices. `options`: settings of OSQP; solvers of qpsolvers take the tolerance.
    Raises ProblemError for a solver that is not installed.
    """
    if callable(solver):
        return solver(qp, options)
    if solver == DEFAULT_SOLVER:
        return OSQPWorkspace(qp.P, qp.q, qp.A, qp.lower, qp.upper, **osqp_settings(options))
    return QpsolversBackend(solver, qp.P, qp.A, options.tolerance)


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


NO_TIME_LIMIT = 1e10  # OSQP's own [s]
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
        return partial(type(self), **self._settings), self._setup

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
