"""What a solver of the QP is asked, and what it answers: OSQP by default, or any other."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol, Self

import numpy as np

from kmpc_lite.types import Array

INFINITY = 1e30
"""Bounds beyond this are open, as OSQP itself has it. A row must not change between open and
closed: OSQP would factorise anew."""
LARGEST = 1e10
"""Entries of P, A or q beyond this make factorisations fail."""


class QPStatus(Enum):
    """What became of a QP."""

    SOLVED = "solved"
    STOPPED_EARLY = "stopped early"
    """Iteration or time limit: the iterate is finite and worth checking."""
    FAILED = "failed"
    """Infeasible, bad data or not finite: there is no iterate."""


class QPSolution(NamedTuple):
    """An iterate with its status; `x` and `y` are copies."""

    status: QPStatus
    x: Array
    """(n,)."""
    y: Array
    """(m,) multipliers: positive at an upper bound, negative at a lower one."""
    iterations: int
    """Zero if the solver does not tell."""
    primal_residual: float
    dual_residual: float
    reason: str

    @classmethod
    def failed(cls, variables: int, rows: int, reason: str) -> Self:
        """Answer that a QP with so many variables and rows has no iterate."""
        nothing = np.zeros(variables), np.zeros(rows)
        return cls(QPStatus.FAILED, *nothing, 0, np.inf, np.inf, reason)


class QPSolver(Protocol):
    """Solves ``min x'Px/2 + q'x, l <= Ax <= u`` again and again, with new numbers each time.

    A solution depends on the arguments only, not on what was solved before. Solvers copy and
    pickle.

    Attributes
    ----------
    n, m : int
        How many variables and rows there are.
    """

    n: int
    m: int

    @property
    def can_be_stopped(self) -> bool:
        """Whether `time_limit` has an effect."""
        ...

    def restart(self) -> None:
        """Forget what a solver may learn from one solve to the next; called once a step."""
        ...

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
        """Solve with new numbers from a warm start.

        Parameters
        ----------
        q, lower, upper : ndarray
            (n,), (m,), (m,).
        Ax : ndarray
            All stored entries of A, in CSC order, (nnz,).
        x, y : ndarray
            Warm start (n,), (m,); one that is not finite is replaced by zeros.
        Px : ndarray, optional
            All stored entries of P, in CSC order; those of the setup if not given.
        time_limit : float, optional
            When to stop [s]; what there is by then comes back as STOPPED_EARLY.

        Raises
        ------
        ValueError
            For wrong shapes.
        """
        ...
