"""A problem that contradicts itself is refused by the name of the field.

A good one is what the paper says.
"""

from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lab.peers.ipopt import AREA
from kmpc_lite import NavigationProblem, ProblemError

NAN, INF = float("nan"), float("inf")
WRONG: dict[str, tuple[Any, ...]] = {
    "horizon": (0, 1001, 2.0, True, NAN),
    "dt": (0.0, NAN, (0.1,)),
    "robot_radius": (-0.01, INF),
    "margin": (-0.01, NAN, [0.1]),
    "goal_tolerance": ((0.05, 0.0), (0.05, INF), (0.05,), "near"),
    "Q": ((1.0, 1.0), (1.0, NAN, 1.0), (1.0, -1.0, 1.0), np.eye(2), "abc", 3.0),
    "R": ((1.0, 1.0, 1.0), (-1.0, 1.0), [[1, 2], [0, 1]]),
    "Q_terminal": ((1.0, 1.0), (0.0, 0.0, -1.0)),
    "u_min": ((NAN, -1.0), (-INF, -1.0), (0.7, -1.0), (-0.6,), None),
    "u_max": ((0.6, INF), (-0.6, 1.0), ("a", "b")),
    "x_min": ((2.0, -2.0, -INF), (NAN, -2.0, -INF), (-2.0, -2.0, -3.0), (-2.0, -2.0)),
    "x_max": ((2.0, 2.0, 3.0), (2.0, -2.0, INF)),
    "deceleration": ((0.0, 1.0), (INF, 1.0), (1.0,)),
    "du_max": ((-1.0, 1.0), (NAN, 1.0), 1.0),
    "slack_weights": ((0.0, 1.0), (1.0, INF), (1.0, 1.0, 1.0)),
}


@pytest.mark.parametrize(("field", "value"), [(f, v) for f, vs in WRONG.items() for v in vs])
def test_every_wrong_field_is_named(field: str, value: Any) -> None:
    with pytest.raises(ProblemError, match=field) as caught:
        NavigationProblem(**{**AREA, field: value})
    assert "\n" not in str(caught.value)


def test_replace_checks_again_and_accepts_what_is_validated() -> None:
    problem = NavigationProblem(Q_terminal=(1.0, 2.0, 3.0))
    other = replace(problem, margin=0.1)
    assert other.margin == 0.1
    np.testing.assert_array_equal(other.weights[2], np.diag([1.0, 2.0, 3.0]))
    with pytest.raises(ProblemError, match="margin"):
        replace(problem, margin=-1.0)


def test_a_problem_cannot_be_changed_by_assignment_or_through_the_callers_arrays() -> None:
    q, u_max = np.array([1.0, 1.0, 1.0]), np.array([0.5, 0.5])
    problem = NavigationProblem(Q=q, u_max=u_max)
    q[:] = 9.0
    u_max[:] = 9.0
    np.testing.assert_array_equal(problem.weights[0], np.eye(3))
    np.testing.assert_array_equal(problem.bounds[1], [0.5, 0.5])
    with pytest.raises(FrozenInstanceError):
        problem.margin = 1.0  # type: ignore[misc]


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6))
def test_cost_is_the_papers_sum(seed: int, n: int) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(3, 3))
    problem = NavigationProblem(
        horizon=n, Q=root @ root.T, R=(0.3, 0.7), R_change=(0.2, 0.4), Q_terminal=(4.0, 5.0, 6.0)
    )
    x, u, goal = random.normal(size=(n + 1, 3)), random.normal(size=(n, 2)), random.normal(size=3)
    total, last = 0.0, random.normal(size=2)
    for k, before in zip(range(n), (last, *u), strict=False):
        total += 0.2 * (u[k, 0] - before[0]) ** 2 + 0.4 * (u[k, 1] - before[1]) ** 2
        total += (x[k] - goal) @ (root @ root.T) @ (x[k] - goal)
        total += 0.3 * u[k, 0] ** 2 + 0.7 * u[k, 1] ** 2
    total += float(np.sum(np.array([4.0, 5.0, 6.0]) * (x[n] - goal) ** 2))
    for told in (goal, np.tile(goal, (n + 1, 1))):
        assert problem.cost(x, u, told, last=last) == pytest.approx(total, rel=1e-9)
