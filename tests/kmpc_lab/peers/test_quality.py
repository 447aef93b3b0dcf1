"""Ours, converged, against IPOPT.

The same minimum, and words for states if there is none to compare.
"""

import numpy as np
import pytest

from kmpc_lab.bench.drives import TUNING_SEED, RecordedDrive, learned_model, record
from kmpc_lab.bench.quality import EQUAL, OBEYED, VERDICTS, compare, format_comparison
from kmpc_lite.control.problem import NavigationProblem

pytest.importorskip("casadi", reason="the extra peers is not installed")


def test_ours_converges_to_what_ipopt_finds() -> None:
    model, problem = learned_model(), NavigationProblem()
    drives = record(model, problem, 2, TUNING_SEED + 50, 12)
    rows = compare(model, problem, drives)
    assert len(rows) == 24
    assert all(
        row.verdict == "as good" and row.excess <= EQUAL and row.violation <= OBEYED for row in rows
    )
    assert "as good on 24 of the 24 states" in format_comparison(rows)


def test_a_start_in_an_obstacle_is_distinguished() -> None:
    model, problem = learned_model(), NavigationProblem()
    inside = RecordedDrive(
        np.array([[0.3, 0.0, 3.5]]),
        np.array([1.5, 0.0, 0.0]),
        np.array([[0.0, 0.0, 0.2, 0.0, 0.0]]),
    )
    (row,) = compare(model, problem, [inside])
    assert row.verdict == "starts inside" and row.verdict in VERDICTS
    assert "states on which IPOPT" not in format_comparison([row])
