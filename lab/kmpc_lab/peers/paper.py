"""The paper's problem: what peers solve and benchmarks time unless another one is given."""

from __future__ import annotations

from typing import Any

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

AREA: dict[str, Any] = {"x_min": (-2.0, -2.0, -np.inf), "x_max": (2.0, 2.0, np.inf)}
"""Fields of a problem whose robot stays within 2 m of the origin along both axes."""


def papers_problem() -> NavigationProblem:
    """Build the defaults, which are the paper's, with the paper's area."""
    return NavigationProblem(**AREA)


def check_weights(problem: NavigationProblem) -> NavigationProblem:
    """Give a problem that peers can solve; raises ProblemError for a weight that they lack."""
    if problem.change_weight.any():
        raise ProblemError("R_change: peers weigh no changes of commands; it must not be given")
    return problem


def short_way(goal: Array, pose: Array) -> Array:
    """Give a goal (3,) whose heading is within half a turn of a pose's (3,): costs count turns."""
    out = goal.copy()
    out[2] = float(pose[2]) + wrap(float(goal[2]) - float(pose[2]))
    return out
