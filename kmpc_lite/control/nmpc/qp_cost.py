"""The cost of the sparse QP: its pattern is built once, numbers are written in place."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import INPUTS, STATES, Array


class QPCost:
    """Matrices P and q of the QP.

    Parameters
    ----------
    problem : NavigationProblem
        Weights.
    state_columns, input_columns, slack_columns : ndarray
        Where the variables of each stage stand: (N, 3), (N, 2), (N,).
    curved : bool
        Whether `fill` may write other Hessians than the problem's own.

    Attributes
    ----------
    P : csc_matrix
        Its upper triangle.
    q : ndarray
        Linear part.
    stage_cost, terminal_cost : ndarray
        The problem's own Hessians (N, 5, 5) and (3, 3).
    terminal_share : float
        Part of the terminal weight that counts.
    slack_penalty : float
        Linear weight of the slacks [1/m].
    """

    def __init__(
        self,
        problem: NavigationProblem,
        state_columns: Array,
        input_columns: Array,
        slack_columns: Array,
        curved: bool,
    ) -> None:
        q, r, q_terminal = problem.weights
        linear, quadratic = problem.slack_weights
        n = problem.horizon
        self.terminal_share = 1.0
        self.terminal_cost = self._whole_terminal_cost = 2 * q_terminal
        self.stage_cost = np.zeros((n, STATES + INPUTS, STATES + INPUTS))
        self.stage_cost[:, :STATES, :STATES] = 2 * q
        self.stage_cost[:, STATES:, STATES:] = 2 * r
        self._slack_cost = np.full(n, 2 * quadratic)
        # upper triangles: of the stages' blocks, whose first has no state among the variables, and
        # of the last state's
        given = np.full((1, STATES), -1)
        columns = np.concatenate(
            [np.concatenate([given, state_columns[:-1]]), input_columns], axis=1
        )
        upper = np.triu_indices(STATES + INPUTS)
        stored = (self.stage_cost[0][upper] != 0.0) | curved
        self._stage_entries = upper[0][stored], upper[1][stored]
        self._last_entries = np.triu_indices(STATES)
        rows, cols = (
            np.concatenate([columns[:, stage].ravel(), state_columns[-1][last], slack_columns])
            for stage, last in zip(self._stage_entries, self._last_entries, strict=True)
        )
        order = np.lexsort((rows, cols))
        # where the entries of P come from, in CSC order
        self._from = order[rows[order] >= 0]
        size = (STATES + INPUTS + 1) * n
        pointers = np.concatenate([[0], np.cumsum(np.bincount(cols[self._from], minlength=size))])
        values = self._entries(self.stage_cost, self.terminal_cost)
        self.P = sp.csc_matrix((values, rows[self._from], pointers), shape=(size, size))
        self.q = np.zeros(size)
        self._slack_columns = slack_columns
        self.set_slack_penalty(float(linear))
        self._pull, self._pull_terminal = -2 * q, -self.terminal_cost
        self._q_states = self.q[: STATES * n].reshape(n, STATES)
        self._q_inputs = self.q[STATES * n : (STATES + INPUTS) * n].reshape(n, INPUTS)

    def _entries(self, stages: Array, terminal: Array) -> Array:
        """Entries of P in CSC order for Hessians (N, 5, 5) and (3, 3)."""
        i, j = self._stage_entries
        entries: Array = np.concatenate(
            [stages[:, i, j].ravel(), terminal[self._last_entries], self._slack_cost]
        )[self._from]
        return entries

    def pull_to(self, reference: Array) -> None:
        """Write the reference (N + 1, 3) that states are drawn to."""
        np.matmul(reference[1:-1], self._pull, out=self._q_states[:-1])
        np.matmul(reference[-1], self._pull_terminal, out=self._q_states[-1])

    def fill(self, stages: Array, terminal: Array, x: Array, u: Array) -> None:
        """Write other Hessians than the problem's own, after `pull_to`.

        What they add to the cost is zero at the iterate, and so is its slope.

        Parameters
        ----------
        stages, terminal : ndarray
            Convex, (N, 5, 5) by state and command, of the first by the command alone, and (3, 3).
        x, u : ndarray
            The iterate: (N + 1, 3), (N, 2).
        """
        self.P.data[:] = self._entries(stages, terminal)
        slopes = ((stages - self.stage_cost) @ np.concatenate([x[:-1], u], axis=1)[..., None])[
            ..., 0
        ]
        self._q_states[:-1] -= slopes[1:, :STATES]
        self._q_states[-1] -= (terminal - self.terminal_cost) @ x[-1]
        self._q_inputs[:] = -slopes[:, STATES:]

    def set_slack_penalty(self, weight: float) -> None:
        """Write the linear weight of the slacks [1/m]."""
        self.slack_penalty = weight
        self.q[self._slack_columns] = weight

    def set_terminal_share(self, share: float) -> None:
        """Write how much of the terminal weight counts, from 0 to 1."""
        if share == self.terminal_share:
            return
        self.terminal_share, self.terminal_cost = share, share * self._whole_terminal_cost
        self._pull_terminal = -self.terminal_cost
        self.P.data[:] = self._entries(self.stage_cost, self.terminal_cost)
