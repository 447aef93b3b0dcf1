"""A problem for OSQP that can be solved by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from kmpc_lite.control.nmpc.qp_solvers import OSQPWorkspace, QPData, QPSolution, QPStatus

EXACT: dict[str, Any] = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 50_000}


class Box:
    """min |x - target|^2 / 2 within a box that A scales: all of it can be computed by hand."""

    def __init__(self, n: int = 3, **options: Any) -> None:
        self.n = n
        self.data: dict[str, np.ndarray] = {
            "q": np.zeros(n),
            "lower": -np.ones(n),
            "upper": np.ones(n),
            "Ax": np.ones(n),
            "x": np.zeros(n),
            "y": np.zeros(n),
        }
        identity = sparse.csc_matrix(np.eye(n))
        self.workspace = OSQPWorkspace(
            identity,
            self.data["q"],
            identity,
            self.data["lower"],
            self.data["upper"],
            **{**EXACT, **options},
        )

    def solve(self, **changes: np.ndarray) -> QPSolution:
        return self.workspace.solve(QPData(**{**self.data, **changes}))

    def assert_well(self) -> None:
        """The workspace still solves its plain problem, with nothing left of an earlier one."""
        answer = self.solve(q=-0.5 * np.arange(self.n))
        assert answer.status is QPStatus.SOLVED
        np.testing.assert_allclose(answer.x, np.clip(0.5 * np.arange(self.n), -1, 1), atol=1e-6)


def assert_failed(answer: QPSolution) -> None:
    """No iterate, and nothing that could be taken for one."""
    assert answer.status is QPStatus.FAILED
    assert answer.reason
    assert not answer.x.any() and not answer.y.any()
