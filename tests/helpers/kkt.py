"""An optimality certificate that knows nothing of how a plan was found.

The nonlinear problem with its soft penalty: minimise the cost plus ``linear s + quadratic s^2`` for
each stage 1 to N, subject to the dynamics by `KoopmanModel.predict`, command bounds, ``gap + s >=
0`` for each obstacle and side of the area, ``s >= 0``. Derivatives are taken by differences;
multipliers of the right sign, zero if a constraint is not active, are sought by bounded least
squares. A plan is a Karush-Kuhn-Tucker point where some exist that leave no gradient. The linear
weight may be the problem's or a stronger one: an exact penalty is one that is strong enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

import kmpc_lite as kl

ACTIVE = 1e-4  # a constraint this near to its bound counts as active [m, m/s, rad/s]


@dataclass(frozen=True)
class Certificate:
    """What a plan lacks to be a KKT point."""

    stationarity: float  # norm of the Lagrangian's gradient, as a share of the cost's
    defect: float  # largest gap in the dynamics [m, rad]
    bounds: float  # largest excess over a command bound
    violation: float  # largest penetration of an obstacle or a side [m]; what the slacks hold
    active_gaps: int  # obstacle and side constraints that are active


def windows(past: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Commands before each stage, oldest first, (N, L, 2)."""
    commands = np.vstack([past, inputs])
    return np.array([commands[k : k + len(past)] for k in range(len(inputs))])


def goal_reference(x: Sequence[float], goal: Sequence[float]) -> np.ndarray:
    """The goal with the heading that is nearest to the pose's."""
    turn = np.remainder(goal[2] - x[2] + np.pi, 2 * np.pi) - np.pi
    return np.array([goal[0], goal[1], x[2] + turn])


def jacobian(
    function: Callable[[np.ndarray], np.ndarray], v: np.ndarray, step: float
) -> np.ndarray:
    """Central differences, (m, n)."""
    columns = []
    for i in range(len(v)):
        up, down = v.copy(), v.copy()
        up[i] += step
        down[i] -= step
        columns.append((np.atleast_1d(function(up)) - np.atleast_1d(function(down))) / (2 * step))
    return np.array(columns).T


def certify(  # noqa: C901 - one proof: its parts share all that they know
    model: kl.KoopmanModel,
    problem: kl.NavigationProblem,
    plan: kl.Plan,
    reference: np.ndarray,
    circles: Sequence[kl.Circle] = (),
    past: np.ndarray | None = None,
) -> Certificate:
    """Seek multipliers for a plan."""
    n, x0 = problem.horizon, plan.states[0]
    u_min, u_max, x_min, x_max = problem.bounds
    linear, quadratic = problem.slack_weights
    past = np.zeros((model.history, 2)) if past is None else past

    def states_of(v: np.ndarray) -> np.ndarray:
        return np.vstack([x0, v[: 3 * n].reshape(n, 3)])

    def inputs_of(v: np.ndarray) -> np.ndarray:
        return v[3 * n :].reshape(n, 2)

    def cost(v: np.ndarray) -> np.ndarray:
        return np.array([problem.cost(states_of(v), inputs_of(v), reference)])

    def defects(v: np.ndarray) -> np.ndarray:
        x, u = states_of(v), inputs_of(v)
        following = model.predict(x[:-1], u, windows(past, u) if model.history else None)
        return (x[1:] - following).ravel()

    def gaps(v: np.ndarray) -> np.ndarray:
        p = states_of(v)[1:, :2]
        times = problem.dt * np.arange(1, n + 1)
        keep = problem.robot_radius + problem.margin
        columns = [
            np.hypot(p[:, 0] - c.x - c.vx * times, p[:, 1] - c.y - c.vy * times) - c.radius - keep
            for c in circles
        ]
        # a robot that stands outside the area must not go farther out
        for axis in (0, 1):
            columns.append(p[:, axis] - min(x_min[axis], x0[axis]))
            columns.append(max(x_max[axis], x0[axis]) - p[:, axis])
        return np.column_stack(columns).ravel()

    v = np.concatenate([plan.states[1:].ravel(), plan.inputs.ravel()])
    gradient = jacobian(cost, v, 1e-3)[0]
    gap = gaps(v).reshape(n, -1)
    slack = np.maximum(-gap.min(axis=1), 0.0)

    columns, lower, upper = [], [], []

    def add(column: np.ndarray, by_slack: np.ndarray, low: float, high: float) -> None:
        columns.append(np.concatenate([column, by_slack]))
        lower.append(low)
        upper.append(high)

    none = np.zeros(n)
    for row in jacobian(defects, v, 1e-5):
        add(row, none, -np.inf, np.inf)
    gap_rows = jacobian(gaps, v, 1e-5).reshape(n, -1, len(v))
    active_gaps = 0
    for k in range(n):
        for i in range(gap.shape[1]):
            if gap[k, i] + slack[k] <= ACTIVE:
                add(-gap_rows[k, i], -np.eye(n)[k], 0.0, np.inf)
                active_gaps += 1
        if slack[k] <= ACTIVE:
            add(np.zeros(len(v)), -np.eye(n)[k], 0.0, np.inf)
    for i in range(2 * n):
        value, low, high = v[3 * n + i], u_min[i % 2], u_max[i % 2]
        row = np.zeros(len(v))
        row[3 * n + i] = 1.0
        if value >= high - ACTIVE:
            add(row, none, 0.0, np.inf)
        elif value <= low + ACTIVE:
            add(-row, none, 0.0, np.inf)
    matrix = np.array(columns).T
    residuals = []
    for growth in (1.0, 10.0, 100.0, 1000.0):
        right = -np.concatenate([gradient, growth * linear + 2 * quadratic * slack])
        found = lsq_linear(matrix, right, (lower, upper), tol=1e-13)
        residuals.append(float(np.linalg.norm(matrix @ found.x - right)))
    return Certificate(
        stationarity=min(residuals) / float(np.linalg.norm(gradient)),
        defect=float(np.abs(defects(v)).max()),
        bounds=float(max((plan.inputs - u_max).max(), (u_min - plan.inputs).max())),
        violation=float(slack.max()),
        active_gaps=active_gaps,
    )
