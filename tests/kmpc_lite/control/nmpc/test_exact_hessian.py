"""The Hessian of the Lagrangian, against differences of its definitions, and what it is for."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.nmpc.exact_hessian import convex, dynamics_curvature, hessians
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.world.circles import circles_to_array
from kmpc_lite.control.world.half_planes import KeepOut

PROBLEM = kl.NavigationProblem(horizon=6)
LEAST = 0.1


def second_differences(function, point, step=1e-3):  # type: ignore[no-untyped-def]
    """Hessian of a scalar function by central differences."""
    n = len(point)
    out, moves = np.empty((n, n)), step * np.eye(n)
    for i in range(n):
        for j in range(n):
            corners = [
                function(point + a * moves[i] + b * moves[j]) * a * b
                for a in (1, -1)
                for b in (1, -1)
            ]
            out[i, j] = sum(corners) / (4 * step * step)
    return out


@pytest.mark.parametrize("name", ["nominal", "learned", "learned_edmdc"])
def test_curvature_of_the_dynamics(name: str, models: dict[str, kl.KoopmanModel]) -> None:
    model, random = models[name], np.random.default_rng(1)
    states, inputs, multipliers = (
        random.normal(size=(5, 3)),
        random.normal(size=(5, 2)),
        30 * random.normal(size=(5, 3)),
    )
    found = dynamics_curvature(model, states, inputs, multipliers)
    for k in range(5):
        expected = second_differences(
            lambda z, k=k: multipliers[k] @ model.predict(z[:3], z[3:]),
            np.concatenate([states[k], inputs[k]]),
        )
        np.testing.assert_allclose(found[k], expected, atol=2e-4 * max(1.0, np.abs(expected).max()))


def test_stages_hold_cost_dynamics_and_circles(
    nominal: kl.KoopmanModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "kmpc_lite.control.nmpc.exact_hessian.convex", lambda blocks, least: blocks
    )  # the Hessian as it is
    n, slots, random = PROBLEM.horizon, 5, np.random.default_rng(2)
    given = [kl.Circle(0.5, 0.3, 0.1), kl.Circle(-0.4, 0.8, 0.2, 0.1, -0.2)]
    circles = things_of(circles_to_array(given))
    states, inputs = (
        np.cumsum(random.normal(size=(n + 1, 3)) * 0.1, axis=0),
        random.normal(size=(n, 2)) * 0.4,
    )
    keep_out, qp = KeepOut(PROBLEM, slots), NavigationQP(PROBLEM, 0, slots, curved=True)
    found = keep_out.clearances(states, circles, None)
    normals, _ = keep_out.half_planes(states, found.values, found.normals)
    duals = random.normal(size=qp.row_count)
    duals[qp.half_plane_rows] = -np.abs(duals[qp.half_plane_rows])
    stages, terminal = hessians(
        nominal, qp, states, inputs, duals, normals, keep_out.bends(states, circles)
    )
    q, r, q_terminal = PROBLEM.weights

    # which slot holds which obstacle: two circles and the nearest three of four sides, in the order
    # of the obstacles
    def lagrangian(k, z):  # type: ignore[no-untyped-def]
        value = (
            z[:3] @ q @ z[:3]
            + z[3:] @ r @ z[3:]
            - duals[qp.dynamics_rows[k]] @ nominal.predict(z[:3], z[3:])
        )
        return value + room(k, z[:2])

    def room(k, p):  # type: ignore[no-untyped-def]
        where = circles[:, :2] + k * PROBLEM.dt * circles[:, 3:5]
        return qp.half_plane_scale * duals[qp.half_plane_rows[k - 1, :2]] @ np.hypot(*(p - where).T)

    for k in range(1, n):
        expected = second_differences(
            lambda z, k=k: lagrangian(k, z), np.concatenate([states[k], inputs[k]])
        )
        np.testing.assert_allclose(stages[k], expected, atol=2e-3 * np.abs(expected).max())
    expected = second_differences(lambda z: z @ q_terminal @ z + room(n, z[:2]), states[n])
    np.testing.assert_allclose(terminal, expected, atol=2e-3 * np.abs(expected).max())


def test_convex_matrices_stay_and_others_are_turned_round() -> None:
    random = np.random.default_rng(3)
    square = random.normal(size=(10, 5, 5))
    definite = square @ square.transpose(0, 2, 1) + 0.2 * np.eye(5)
    np.testing.assert_allclose(convex(definite, LEAST), definite, atol=1e-9)
    np.testing.assert_allclose(convex(-definite, LEAST), definite, atol=1e-9)
    assert (
        np.linalg.eigvalsh(convex(1e-6 * (square + square.transpose(0, 2, 1)), LEAST)).min()
        >= LEAST - 1e-12
    )


def test_a_qp_with_other_hessians_is_the_old_one_at_the_iterate() -> None:
    n, random = PROBLEM.horizon, np.random.default_rng(4)
    plain, curved = NavigationQP(PROBLEM, 0, 3), NavigationQP(PROBLEM, 0, 3, curved=True)
    x, u = random.normal(size=(n + 1, 3)), random.normal(size=(n, 2))
    stages = convex(random.normal(size=(n, 1, 1)) * np.ones((5, 5)) + plain.cost.stage_cost, LEAST)
    stages[0, :3, 3:] = stages[0, 3:, :3] = 0.0
    terminal = plain.cost.terminal_cost + np.eye(3)

    def objective(qp: NavigationQP, v: np.ndarray) -> float:
        upper = qp.P.toarray()
        return float(0.5 * v @ (upper + np.triu(upper, 1).T) @ v + qp.q @ v)

    for _ in range(2):  # again after a fill: nothing is left over
        curved.q[:] = plain.q
        curved.cost.fill(stages, terminal, x, u)
        differences = []
        for _ in range(4):
            dx, du = random.normal(size=(n + 1, 3)), random.normal(size=(n, 2))
            dx[0] = 0.0
            v = plain.pack(x + dx, u + du, random.normal(size=n))
            more = sum(
                0.5 * d @ (stages[k] - plain.cost.stage_cost[k]) @ d
                for k, d in enumerate(np.concatenate([dx[:-1], du], axis=1))
            )
            more += 0.5 * dx[-1] @ (terminal - plain.cost.terminal_cost) @ dx[-1]
            differences.append(objective(curved, v) - objective(plain, v) - more)
        # but for what no variable changes
        np.testing.assert_allclose(differences, differences[0], atol=1e-8)


@pytest.mark.parametrize(
    ("x", "goal", "circles"),
    [
        (
            (0.792, 1.577, 1.796),
            (1.442, -0.488, 2.924),
            [
                (-0.093, 1.048, 0.266),
                (-0.776, 0.225, 0.225),
                (0.081, -0.469, 0.112),
                (0.859, -0.849, 0.171),
            ],
        ),
        (
            (0.71, -0.838, 1.597),
            (0.942, 1.786, 2.648),
            [
                (-1.232, 1.016, 0.209),
                (1.14, -0.656, 0.227),
                (0.152, -0.359, 0.222),
                (-1.543, -0.921, 0.161),
            ],
        ),
        (
            (0.705, -1.208, 1.62),
            (0.942, 1.786, 2.648),
            [
                (-1.232, 1.016, 0.209),
                (1.14, -0.656, 0.227),
                (0.152, -0.359, 0.222),
                (-1.543, -0.921, 0.161),
            ],
        ),
    ],
)
def test_states_on_which_gauss_newton_needs_hundreds_of_passes(
    x: tuple[float, ...],
    goal: tuple[float, ...],
    circles: list[tuple[float, ...]],
    learned: kl.KoopmanModel,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def passes() -> int:
        controller = kl.Controller(
            learned, guidance=False, tightening=None, sqp_iterations=300, tolerance=1e-6
        )
        return controller.step(x, goal, [kl.Circle(*c) for c in circles]).iterations

    newton = passes()
    monkeypatch.setattr(
        "kmpc_lite.control.nmpc.fill_qp.hessians",
        lambda _, qp, *rest: (qp.cost.stage_cost, qp.cost.terminal_cost),
    )
    assert newton <= 40 and newton < 0.5 * passes()
