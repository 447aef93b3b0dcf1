"""The sparse QP of one SQP pass: its pattern is built once, numbers are written in place.

Variables: states X_1 .. X_N, commands U_0 .. U_{N-1}, one slack S_1 .. S_N per stage. The present
state is data. Rows: dynamics (3 per stage), half-planes that keep the robot away from obstacles
(`slots` per stage), command bounds, slack >= 0, and, where the problem limits them, changes of the
commands from stage to stage, the first from the command sent last, the speeds of both wheels, and
how a car steers. A `Trajectory` is what a pass starts from and ends at.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from kmpc_lite.control.input_checks import POSITION_LIMIT
from kmpc_lite.control.kernels.records import Numbers
from kmpc_lite.control.options import fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.wheels import Car
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.model.arguments import windows
from kmpc_lite.types import STATES, Array

OPEN = 1e3  # bound of an unused half-plane row [m]: finite, so that OSQP keeps its factorisation
LOST, LOST_TURN = 10 / 3, 1.0
"""A pose farther from the predicted one [radii, rad] makes the last plan worthless as a start."""
HALF_PLANE_SCALE, SLACK_SCALE = 4.0, 8.0
"""Factors of the rows of half-planes, and of those that keep slacks from being negative: their
multipliers are large, and settle in fewer iterations of ADMM if they are scaled down."""
CHANGE, MOST_CHANGE_SCALE = 0.2, 16.0
"""Rows that limit changes are scaled so that the largest one is this [m/s, rad/s], if it is less,
and by no more than this: a plan ends at speeds that few small changes add up to, and ADMM finds
these in fewer iterations if they count more."""


class QPCost:
    """Matrices P and q of the QP.

    `problem`: weights.

    Attributes: `P`: its upper triangle. `q`: linear part. `terminal_share`: part of the terminal
    weight that counts. `pull`, `pull_terminal`: (3, 3) by which references enter `q`, at the stages
    before the last one and at the last.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        q, r, q_terminal = (sp.csc_matrix(2 * weight) for weight in problem.weights)
        weight = q.toarray()
        places = np.nonzero((weight != 0.0) | np.diag([False, False, True]))  # it may bend
        q = sp.csc_matrix((weight[places], places), shape=weight.shape)
        commands = sp.kron(sp.eye(problem.horizon), r)
        if problem.change_weight.any():
            to_last = sp.diags([1.0, -1.0], [0, -1], shape=(problem.horizon, problem.horizon))
            commands = commands + sp.kron(to_last.T @ to_last, 2 * problem.change_weight)
        linear, quadratic = problem.slack_weights
        n = problem.horizon
        # stored whole, so that a terminal weight of zero keeps its places
        last = sp.csc_matrix(np.ones((STATES, STATES)))
        blocks = [q] * (n - 1) + [last, commands, 2 * quadratic * sp.eye(n)]
        self.P = sp.triu(sp.block_diag(blocks), format="csc")
        self.q = np.zeros(self.P.shape[0])
        self.q[(STATES + len(problem.u_min)) * n :] = linear
        self.pull = np.ascontiguousarray(-q.toarray())
        self._pull_last = np.ascontiguousarray(-q_terminal.toarray())
        # columns of the last state begin after those of the others
        first = self.P.indptr[STATES * (n - 1)]
        self._last = self.P.data[first : first + STATES * (STATES + 1) // 2]
        self._whole = q_terminal.toarray().T[np.tril_indices(STATES)]
        self.turn_places = self.P.indptr[STATES * np.arange(1, n)] - 1
        """Where the headings before the last one stand among the entries of P, (N - 1,)."""
        self.pull_terminal, self.terminal_share = np.empty((STATES, STATES)), -1.0
        self.set_terminal_share(1.0)

    def set_terminal_share(self, share: float) -> None:
        """Write how much of the terminal weight counts, from 0 to 1."""
        if share != self.terminal_share:
            self.terminal_share = share
            np.multiply(share, self._pull_last, out=self.pull_terminal)
            self._last[:] = share * self._whole


class NavigationQP:
    """Matrices P, q, A, lower, upper of the QP, in the form that OSQP wants.

    `problem`: weights, bounds, horizon. `history`: past commands that the model depends on, L.
    `slots`: half-plane rows per stage.

    Attributes: `numbers`: what a pass writes. `change_scale`: factors (2,) of the rows that limit
    changes. `next_stage`: (m,) the row that each row is a period later. `pull_last`: (m, m) by
    which the command that was sent last enters `q`, at the first stage. `lost`, `fastest`: how far
    from where the last plan led the robot may be for that to be a start [m], and the largest number
    that a command may hold.
    """

    def __init__(self, problem: NavigationProblem, history: int, slots: int) -> None:
        self._arguments = problem, history, slots
        n, self.inputs = problem.horizon, len(problem.u_min)
        self.problem, self.horizon, self.history, self.slots = problem, n, history, slots
        self.lost, self.fastest = LOST * unit_length(problem), max(fastest(problem))
        # turning moves what is not round
        self._directions = 2 if problem.footprint is None else 3
        self.state_columns = np.arange(STATES * n).reshape(n, STATES)
        self.input_columns = STATES * n + np.arange(self.inputs * n).reshape(n, self.inputs)
        self.slack_columns = (STATES + self.inputs) * n + np.arange(n)
        self.size = (STATES + self.inputs + 1) * n
        self._limited = np.flatnonzero(np.isfinite(problem.du_max))
        change = problem.dt * problem.du_max
        self.change_scale = np.clip(CHANGE / change, 1.0, MOST_CHANGE_SCALE)
        self._change = (self.change_scale * change)[self._limited]
        wheels = 2 if problem.limits_wheels else 0
        steering = 2 if isinstance(problem.wheels, Car) else 0
        counts = STATES, slots, self.inputs, 1, len(self._limited), wheels, steering
        rows = np.cumsum([0, *counts]) * n
        self.dynamics_rows = np.arange(rows[0], rows[1]).reshape(n, STATES)
        self.half_plane_rows = np.arange(rows[1], rows[2]).reshape(n, slots)
        self.input_rows = np.arange(rows[2], rows[3]).reshape(n, self.inputs)
        self.slack_rows = np.arange(rows[3], rows[4])
        self.change_rows = np.arange(rows[4], rows[5]).reshape(n, len(self._limited))
        self.wheel_rows = np.arange(rows[5], rows[6]).reshape(n, wheels)
        self.steering_rows = np.arange(rows[6], rows[7]).reshape(n, steering)
        self.row_count = int(rows[7])
        self.next_stage = np.empty(self.row_count, dtype=np.intp)
        parts = self.dynamics_rows, self.half_plane_rows, self.input_rows, self.slack_rows
        for part in (*parts, self.change_rows, self.wheel_rows, self.steering_rows):
            self.next_stage[part] = np.concatenate([part[1:], part[-1:]])
        places = self._build_constraints()
        self.cost = QPCost(problem)
        self.P, self.q, self.turn_places = self.cost.P, self.cost.q, self.cost.turn_places
        self.pull_last, self._wanted = -2.0 * problem.change_weight, np.zeros(self.inputs)
        self.lower, self.upper = np.zeros(self.row_count), np.full(self.row_count, np.inf)
        self.upper[self.dynamics_rows] = 0.0
        self.lower[self.half_plane_rows] = -OPEN
        self.lower[self.input_rows], self.upper[self.input_rows] = problem.u_min, problem.u_max
        self.numbers = Numbers(
            places=places,
            entries=self.A.data,
            dynamics_lower=self.lower[: STATES * n].reshape(n, STATES),
            dynamics_upper=self.upper[: STATES * n].reshape(n, STATES),
            half_plane_lower=self.lower[rows[1] : rows[2]].reshape(n, slots),
            pull=self.q[: STATES * n].reshape(n, STATES),
            start=np.zeros(self.size),
            weight=self.cost.pull,
            weight_terminal=self.cost.pull_terminal,
            turn=np.zeros(n - 1),
            turn_weight=float(2.0 * problem.weights[0][2, 2]),
            scale=HALF_PLANE_SCALE,
            open_bound=OPEN,
        )
        self.lower[self.change_rows], self.upper[self.change_rows] = -self._change, self._change
        wheel_speed = problem.max_wheel_speed
        self.lower[self.wheel_rows], self.upper[self.wheel_rows] = -wheel_speed, wheel_speed
        self.lower[self.steering_rows], self.upper[self.steering_rows] = -OPEN, 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        # its arrays are views of each other, which copies would not be
        return type(self), self._arguments

    def _build_constraints(self) -> Array:
        """Build A; return where what every pass writes lies in it, as `kernels.fill` wants it."""
        n, blocks = self.horizon, []

        def block(rows: Array, columns: Array, values: Array | float) -> int:
            """Add entries; return where they begin in the list."""
            rows, columns, values = np.broadcast_arrays(
                rows, columns, np.asarray(values, dtype=float)
            )
            blocks.append((rows.ravel(), columns.ravel(), values.ravel()))
            return sum(len(b[0]) for b in blocks[:-1])

        dynamics, states, inputs = self.dynamics_rows, self.state_columns, self.input_columns
        block(dynamics, states, 1.0)
        a_start = block(dynamics[1:, :, None], states[:-1, None, :], 0.0)
        for j in range(min(self.history, n - 1) + 1):
            block(dynamics[j:, :, None], inputs[: n - j, None, :], 0.0)
        block(self.half_plane_rows[..., None], states[:, None, : self._directions], 0.0)
        end = block(self.half_plane_rows, self.slack_columns[:, None], HALF_PLANE_SCALE)
        block(self.input_rows, inputs, 1.0)
        block(self.slack_rows, self.slack_columns, SLACK_SCALE)
        scale = self.change_scale[self._limited]
        block(self.change_rows, inputs[:, self._limited], scale)
        block(self.change_rows[1:], inputs[:-1, self._limited], -scale)
        if self.problem.limits_wheels:
            half = 0.5 * self.problem.track
            both = np.array(((1.0, -half), (1.0, half)))
            block(self.wheel_rows[..., None], inputs[:, None, :], both)
        steering = block(self.steering_rows[..., None], inputs[:, None, :], 1.0)

        row, column, value = (np.concatenate(part) for part in zip(*blocks, strict=True))
        order = np.lexsort((row, column))
        place = np.empty(len(order), dtype=np.intp)
        place[order] = np.arange(len(order))
        self._steering = place[steering : steering + 2 * self.steering_rows.size]
        pointers = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=self.size))])
        self.A = sp.csc_matrix(
            (value[order], row[order], pointers), shape=(self.row_count, self.size)
        )
        places: Array = place[a_start:end].astype(np.intc)
        return places

    def set_last_command(self, command: Array) -> None:
        """Write the command (2,) that was sent last, from which changes are limited and weighed."""
        self.q[self.input_columns[0]] = self._wanted + self.pull_last @ command
        last = (self.change_scale * command)[self._limited]
        self.lower[self.change_rows[0]] = last - self._change
        self.upper[self.change_rows[0]] = last + self._change

    def set_input_reference(self, inputs: Array, waits: int) -> None:
        """Write commands (N, m) that cost nothing: those of the reference; at first it may wait.

        `set_last_command` comes after it.
        """
        self.q[self.input_columns] = -2.0 * inputs @ self.problem.weights[1]
        self._wanted = self.q[self.input_columns[0]].copy()
        moves = np.arange(self.horizon) >= waits
        first = self.input_rows[:, 0]
        self.lower[first] = moves * self.problem.u_min[0]
        self.upper[first] = moves * self.problem.u_max[0]

    def set_gears(self, gears: Array, sharpest: Array) -> None:
        """Write the gear (N,) of each stage, and the curvatures between which a car steers (2, N).

        ``gear (omega - most v) <= 0 <= gear (omega - least v)``, so that v has the gear's sign.
        """
        rows = gears[:, None, None] * np.ones((1, 2, 2))
        rows[:, 0, 0] *= -sharpest[1]
        rows[:, 1, 0] *= sharpest[0]
        rows[:, 1, 1] *= -1.0
        self.A.data[self._steering] = rows.ravel()

    def unpack(self, variables: Array, here: Array) -> tuple[Array, Array]:
        """States (N + 1, 3) and commands (N, 2) of a solution around the present state (3,)."""
        n = self.horizon
        x = np.empty((n + 1, STATES))
        x[0] = here
        x[1:] = variables[: STATES * n].reshape(n, STATES)
        x[1:, :2] += here[:2]
        return x, variables[STATES * n : (STATES + self.inputs) * n].reshape(n, self.inputs).copy()

    def duals_in_the_open(self) -> Array:
        """Multipliers (m,) if no obstacle is near: only slacks are pressed, by their penalty."""
        y = np.zeros(self.row_count)
        y[self.slack_rows] = -float(self.problem.slack_weights[0]) / SLACK_SCALE
        return y

    def shift_duals(self, y: Array) -> Array:
        """Multipliers one stage on, the last stage kept."""
        return y[self.next_stage]


ROUNDING = 1e-9  # by which a command may pass its bound
FARTHEST = 2 * POSITION_LIMIT
"""From the robot, in its own units, and in its turns [rad]: a plan that leads farther is spoilt."""


class Trajectory(NamedTuple):
    """States, commands and multipliers: an iterate, and a warm start."""

    states: Array  # (N + 1, 3), the first is the present one
    inputs: Array  # (N, 2)
    duals: Array  # (m,) multipliers of the QP's rows


def at_rest(qp: NavigationQP, pose: Array) -> Trajectory:
    """Trajectory of a robot that stands at a pose (3,): a cold start."""
    n = qp.horizon
    return Trajectory(np.tile(pose, (n + 1, 1)), np.zeros((n, qp.inputs)), qp.duals_in_the_open())


def along(qp: NavigationQP, reference: Array, pose: Array) -> Trajectory:
    """Trajectory of a robot that follows a reference (N + 1, 3) from a pose (3,) as it can."""
    dt, n = qp.problem.dt, qp.horizon
    away = reference - pose
    far = np.hypot(away[:, 0], away[:, 1])
    reach = fastest(qp.problem)[0] * dt * np.arange(n + 1)
    states = pose + np.minimum(reach / np.maximum(far, ROUNDING), 1.0)[:, None] * away
    steps = np.diff(states, axis=0)
    cos, sin = np.cos(states[:-1, 2]), np.sin(states[:-1, 2])
    moves = [cos * steps[:, 0] + sin * steps[:, 1], steps[:, 2]]
    if qp.inputs > len(moves):
        moves.insert(1, cos * steps[:, 1] - sin * steps[:, 0])
    inputs = np.column_stack(moves) / dt
    return Trajectory(states, qp.problem.within_bounds(inputs), qp.duals_in_the_open())


def one_period_later(qp: NavigationQP, last: Trajectory | None, here: Array) -> Trajectory | None:
    """Last plan, one period later, if the robot is where that plan put it.

    `qp`: shifts multipliers; its problem has the radius and the command bounds. `last`: the last
    plan; its last stage is held. `here`: present pose (3,), its heading within one turn. Returns
    None for a plan that is stale, or spoilt by whoever got it.
    """
    if last is None:
        return None
    dx, dy, turned = (last.states[1] - here).tolist()
    turns = nearest_turn(turned) if abs(turned) <= POSITION_LIMIT else 0.0
    lost = qp.lost
    # also false for NaN
    if not (abs(dx) <= lost and abs(dy) <= lost and abs(turned - turns) <= LOST_TURN):
        return None
    states = np.concatenate([here[None], last.states[2:], last.states[-1:]])
    inputs = np.concatenate([last.inputs[1:], last.inputs[-1:]])
    duals = qp.shift_duals(last.duals)
    # also false for NaN
    if not (
        np.maximum.reduce(np.abs(states - here), axis=None) <= FARTHEST
        and np.maximum.reduce(np.abs(inputs), axis=None) <= qp.fastest + ROUNDING
        and math.isfinite(np.add.reduce(duals))
    ):
        return None
    if turns:
        states[1:, 2] -= turns
    return Trajectory(states, inputs, duals)


def command_windows(history: int, past: Array, inputs: Array) -> Array | None:
    """Commands before each stage, oldest first, (N, L, 2); none for a model without history.

    `history`: how many past commands the model depends on, L. `past`: (L, 2) commands already sent,
    oldest first. `inputs`: (N, 2) planned commands.
    """
    if not history:
        return None
    return windows(np.concatenate([past, inputs]), history)
