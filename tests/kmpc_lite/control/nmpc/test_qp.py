"""The sparse QP against the same QP written down naively, stage by stage, from its definition."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from kmpc_lite import NavigationProblem
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import Around, Iterate
from kmpc_lite.control.nmpc.qp import HALF_PLANE_SCALE, SLACK_SCALE, NavigationQP
from kmpc_lite.control.nmpc.sqp import keep_out
from kmpc_lite.model.bilinear import Linearization

Q = np.array([[2.0, 0.3, 0.1], [0.3, 5.0, 0.0], [0.1, 0.0, 0.2]])
R = np.array([[0.5, 0.02], [0.02, 0.1]])
Q_TERMINAL = np.array([[7.0, 1.0, 0.0], [1.0, 8.0, -0.5], [0.0, -0.5, 3.0]])
SHAPES = [(1, 0, 1), (2, 0, 3), (5, 0, 2), (20, 0, 6), (1, 3, 1), (3, 1, 2), (4, 6, 2), (12, 3, 4)]
"""Horizons, input histories (longer than the horizon too) and slots."""


class Numbers(NamedTuple):
    """Everything that one fill takes."""

    lin: Linearization
    x: np.ndarray
    u: np.ndarray
    reference: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray


def make_problem(horizon: int) -> NavigationProblem:
    return NavigationProblem(
        horizon=horizon,
        Q=Q,
        R=R,
        Q_terminal=Q_TERMINAL,
        u_min=(-0.3, -1.0),
        u_max=(0.7, 0.9),
        slack_weights=(3.0, 40.0),
    )


def draw(random: np.random.Generator, horizon: int, history: int, slots: int) -> Numbers:
    n, size = horizon, random.normal
    x = size(size=(n + 1, 3))
    x[0, :2] = 0.0  # the QP is solved around it
    lin = Linearization(
        size(size=(n, 3)), size(size=(n, 3, 3)), size(size=(n, 3, 2)), size(size=(n, history, 3, 2))
    )
    return Numbers(
        lin,
        x,
        size(size=(n, 2)),
        size(size=(n + 1, 3)),
        size(size=(n, slots, 2)),
        size(size=(n, slots)),
    )


def objective(
    problem: NavigationProblem, numbers: Numbers, x: np.ndarray, u: np.ndarray, slack: np.ndarray
) -> float:
    """The definition: a sum over stages, the present state's share included."""
    total, n = 0.0, problem.horizon
    for k in range(n):
        error = x[k] - numbers.reference[k]
        total += error @ Q @ error + u[k] @ R @ u[k] + 3.0 * slack[k] + 40.0 * slack[k] ** 2
    error = x[n] - numbers.reference[n]
    return float(total + error @ Q_TERMINAL @ error)


def dynamics_gaps(numbers: Numbers, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """What each stage's next state lacks to obey the linearised model, (N, 3)."""
    lin, dx, du = numbers.lin, (x - numbers.x)[:-1, :, None], (u - numbers.u)[..., None]
    following = lin.value[..., None] + lin.A @ dx + lin.B @ du
    for age in range(1, lin.B_past.shape[1] + 1):  # what was sent before the plan began is known
        following[age:] += lin.B_past[age:, age - 1] @ du[:-age]
    return x[1:] - following[..., 0]


def keepout_gaps(numbers: Numbers, x: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """``normal . p + slack - offset`` of each stage and slot; at least zero if kept."""
    along = np.einsum("nsd,nd->ns", numbers.normals, x[1:, :2])
    return along + slack[:, None] - numbers.offsets


def write(qp: NavigationQP, numbers: Numbers) -> None:
    """Write numbers into a QP: each half-plane as a solid whose nearest point it goes through."""
    _, x, u, _, normals, offsets = numbers
    keep = keep_out(qp.problem, qp.slots)._replace(
        distance=0.0, side_normals=np.empty((0, 2)), side_offsets=np.empty(0)
    )
    points = x[1:, :2].copy()
    gaps = np.einsum("nsd,nd->ns", normals, points) - offsets
    around = Around(np.empty((0, 7)), points, gaps, normals)
    plan = Iterate(x, u, numbers.reference, u, False)
    library.fill(keep, None, qp.numbers, numbers.lin, plan, around)


def pack(x: np.ndarray, u: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """One vector of variables from states (N + 1, 3), commands (N, 2) and slacks (N,)."""
    return np.concatenate([x[1:].ravel(), u.ravel(), slack])


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_filled_qp_is_the_naive_qp(shape: tuple[int, int, int], seed: int) -> None:
    random = np.random.default_rng(seed)
    problem = make_problem(shape[0])
    qp, n = NavigationQP(problem, *shape[1:]), shape[0]
    write(qp, draw(random, *shape))  # leftovers of an earlier fill must not matter
    write(qp, numbers := draw(random, *shape))
    full_p = (qp.P + sparse.triu(qp.P, 1).T).toarray()
    a = qp.A.toarray()
    values, definitions = [], []
    for _ in range(4):
        x = np.vstack([numbers.x[:1], random.normal(size=(n, 3))])
        u, slack = random.normal(size=(n, 2)), random.normal(size=n)
        v = pack(x, u, slack)
        values.append(0.5 * v @ full_p @ v + qp.q @ v)
        definitions.append(objective(problem, numbers, x, u, slack))
        rows = a @ v
        np.testing.assert_allclose(
            rows[qp.dynamics_rows] - qp.lower[qp.dynamics_rows],
            dynamics_gaps(numbers, x, u),
            atol=1e-9,
        )
        np.testing.assert_array_equal(qp.lower[qp.dynamics_rows], qp.upper[qp.dynamics_rows])
        expected = HALF_PLANE_SCALE * keepout_gaps(numbers, x, slack)
        np.testing.assert_allclose(
            rows[qp.half_plane_rows] - qp.lower[qp.half_plane_rows], expected, atol=1e-9
        )
        assert np.isposinf(qp.upper[qp.half_plane_rows]).all()
        np.testing.assert_allclose(
            rows[qp.input_rows] - qp.lower[qp.input_rows], u - (-0.3, -1.0), atol=1e-12
        )
        np.testing.assert_allclose(
            qp.upper[qp.input_rows] - rows[qp.input_rows], (0.7, 0.9) - u, atol=1e-12
        )
        np.testing.assert_allclose(
            rows[qp.slack_rows] - qp.lower[qp.slack_rows], SLACK_SCALE * slack, atol=1e-12
        )
        assert np.isposinf(qp.upper[qp.slack_rows]).all()
    # the objectives may differ by what no variable changes
    np.testing.assert_allclose(np.diff(values), np.diff(definitions), rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("du_max", [(1.0, 4.0), (np.inf, 2.0), (0.5, np.inf)])
def test_changes_of_commands_are_rows_where_they_are_limited(du_max: tuple[float, float]) -> None:
    free, problem = NavigationQP(make_problem(5), 1, 2), replace(make_problem(5), du_max=du_max)
    qp, random = NavigationQP(problem, 1, 2), np.random.default_rng(3)
    last, u = random.normal(size=2), random.normal(size=(5, 2))
    qp.set_last_command(last)
    values = qp.A @ pack(np.zeros((6, 3)), u, np.zeros(5))
    columns = [j for j in range(2) if np.isfinite(du_max[j])]
    for k in range(5):
        before = u[k - 1] if k else last
        for row, j in zip(qp.change_rows[k], columns, strict=True):
            # how much room the row leaves on either side is what the change leaves
            most, change, scale = problem.dt * du_max[j], u[k, j] - before[j], qp.change_scale[j]
            np.testing.assert_allclose(qp.upper[row] - values[row], scale * (most - change))
            np.testing.assert_allclose(values[row] - qp.lower[row], scale * (most + change))
    # nothing else has changed, and without limits there is no such row
    assert free.change_rows.size == 0 and qp.row_count == free.row_count + qp.change_rows.size
    assert (qp.A[: free.row_count] != free.A).nnz == 0
    shifted = qp.shift_duals(np.arange(qp.row_count, dtype=float))
    np.testing.assert_array_equal(shifted[qp.change_rows[:-1]], qp.change_rows[1:])
