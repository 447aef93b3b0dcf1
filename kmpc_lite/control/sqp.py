"""Sequential quadratic programming: linearise, fill, solve, step.

One pass per period from the shifted last solution is the real-time iteration; more passes with a line search on an
exact L1 merit function converge to a Karush-Kuhn-Tucker point of the nonlinear problem.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from kmpc_lite.control.obstacles import KeepOut, penetration
from kmpc_lite.control.osqp_workspace import OSQPWorkspace, QPStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.qp import NavigationQP
from kmpc_lite.dictionary import Array
from kmpc_lite.model import KoopmanModel

REAL_TIME: dict[str, Any] = {
    "eps_abs": 1e-3,
    "eps_rel": 1e-3,
    "max_iter": 100,
    "rho": 1.0,
    "adaptive_rho": 0,
    "scaling": 3,
    "check_termination": 10,
}
CONVERGED: dict[str, Any] = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20000, "rho": 0.1, "adaptive_rho": 1}
"""OSQP's settings for one pass per period, and for passes to convergence."""

COLD_PASSES = 10
"""Passes without a warm start, at most: the first linearisation, at rest, sees no way to steer."""
COLD_TOLERANCE = 0.02
ARMIJO = 1e-4
SHORTEST_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States (N + 1, 3), commands (N, 2) and the QP's multipliers (m,): an iterate, and a warm start."""

    states: Array
    inputs: Array
    duals: Array


@dataclass(frozen=True, eq=False)
class SQPResult:
    """Where the passes ended."""

    trajectory: Trajectory
    status: QPStatus
    passes: int
    step: float
    """Largest change of the last pass [m, rad, m/s, rad/s]."""
    timing: dict[str, float] = field(default_factory=dict)
    reason: str = ""


class SQP:
    """Solver of one navigation problem with one model; holds all memory that a pass needs.

    Parameters
    ----------
    model : KoopmanModel
        Predicts.
    problem : NavigationProblem
        What is asked.
    iterations : int
        Passes per call at the most; 1 is the real-time iteration.
    tolerance : float
        Change of the trajectory below which passes end.
    slots : int
        Keep-out half-planes per stage: the nearest of all obstacles and sides of the area.
    """

    def __init__(self, model: KoopmanModel, problem: NavigationProblem, iterations: int, tolerance: float, slots: int) -> None:
        self.model, self.problem = model, problem
        self.iterations, self.tolerance = iterations, tolerance
        self.qp = NavigationQP(problem, model.history, slots)
        settings = REAL_TIME if iterations == 1 else CONVERGED
        self.workspace = OSQPWorkspace(self.qp.P, self.qp.q, self.qp.A, self.qp.lower, self.qp.upper, **settings)
        self.keep_out = KeepOut(problem, slots)
        self._penalty = 0.0

    def at_rest(self, x: Array) -> Trajectory:
        """Return the trajectory of a robot that stands at x: a cold start."""
        n = self.problem.horizon
        return Trajectory(np.tile(x, (n + 1, 1)), np.zeros((n, 2)), np.zeros(self.qp.row_count))

    def shift(self, last: Trajectory, x: Array) -> Trajectory:
        """Return the trajectory one period on, from the measured state; the last stage is held."""
        states = np.concatenate([x[None], last.states[2:], last.states[-1:]])
        inputs = np.concatenate([last.inputs[1:], last.inputs[-1:]])
        return Trajectory(states, inputs, self.qp.shift_duals(last.duals))

    def past_windows(self, past: Array, inputs: Array) -> Array | None:
        """Commands before each stage, oldest first, (N, L, 2), from the known past (L, 2) and a plan (N, 2)."""
        if not self.model.history:
            return None
        commands = np.concatenate([past, inputs[:-1]])
        return np.lib.stride_tricks.sliding_window_view(commands, self.model.history, axis=0).transpose(0, 2, 1)

    def solve(self, guess: Trajectory, reference: Array, circles: Array, past: Array, cold: bool) -> SQPResult:
        """Run the passes from a guess whose first state is the present one.

        Parameters
        ----------
        guess : Trajectory
            Where to linearise first.
        reference : ndarray
            States (N + 1, 3).
        circles : ndarray
            (M, 5) rows x, y, radius, vx, vy.
        past : ndarray
            Commands already sent, (L, 2), oldest first.
        cold : bool
            Whether the guess knows nothing: more passes are then allowed.
        """
        timing = {"linearise": 0.0, "fill": 0.0, "solve": 0.0}
        to_convergence = self.iterations > 1
        limit, tolerance = (COLD_PASSES, COLD_TOLERANCE) if cold and not to_convergence else (self.iterations, self.tolerance)
        self._penalty = 0.0
        step, passes, status, reason = np.inf, 0, QPStatus.FAILED, ""
        while passes < limit:
            t0 = perf_counter()
            lin = self.model.linearize(guess.states[:-1], guess.inputs, self.past_windows(past, guess.inputs))
            t1 = perf_counter()
            normals, offsets, violation = self.keep_out.half_planes(guess.states, circles)
            self.qp.fill(lin, guess.states, guess.inputs, reference, normals, offsets)
            t2 = perf_counter()
            warm = self.qp.pack(guess.states, guess.inputs, violation)
            solution = self.workspace.solve(self.qp.q, self.qp.lower, self.qp.upper, self.qp.A.data, warm, guess.duals)
            t3 = perf_counter()
            timing["linearise"] += t1 - t0
            timing["fill"] += t2 - t1
            timing["solve"] += t3 - t2
            passes += 1
            status, reason = solution.status, solution.reason
            if status is QPStatus.FAILED:
                break
            states, inputs, slack = self.qp.unpack(solution.x, guess.states[0])
            length = 1.0
            if limit > 1:
                length = self._line_search(guess, states, inputs, slack, solution.y, lin.value, reference, circles, past)
                states = guess.states + length * (states - guess.states)
                inputs = guess.inputs + length * (inputs - guess.inputs)
            step = max(float(np.abs(states - guess.states).max()), float(np.abs(inputs - guess.inputs).max()))
            guess = Trajectory(states, inputs, solution.y)
            if step <= tolerance:
                break
        return SQPResult(guess, status, passes, step, timing, reason)

    def _soft_cost(self, states: Array, inputs: Array, reference: Array, violation: Array) -> float:
        """Objective with the exact penalty on the violation of each stage (N,)."""
        linear, quadratic = self.problem.slack_weights
        return self.problem.cost(states, inputs, reference) + float(linear * violation.sum() + quadratic * (violation @ violation))

    def _merit(self, states: Array, inputs: Array, predicted: Array, reference: Array, circles: Array) -> float:
        """Exact L1 merit function: objective, penalties, and what the dynamics lack."""
        violation = penetration(self.keep_out.gaps(states, circles)[0])
        return self._soft_cost(states, inputs, reference, violation) + self._penalty * float(np.abs(states[1:] - predicted).sum())

    def _line_search(
        self,
        guess: Trajectory,
        states: Array,
        inputs: Array,
        slack: Array,
        duals: Array,
        predicted: Array,
        reference: Array,
        circles: Array,
        past: Array,
    ) -> float:
        """Length in (0, 1] at which the merit function falls enough (Armijo), by halving."""
        self._penalty = max(self._penalty, 1.1 * float(np.abs(duals[self.qp.dynamics_rows]).max()))
        now = self._merit(guess.states, guess.inputs, predicted, reference, circles)
        expected = now - self._soft_cost(states, inputs, reference, np.maximum(slack, 0.0))
        length = 1.0
        while length > SHORTEST_STEP:
            trial_states = guess.states + length * (states - guess.states)
            trial_inputs = guess.inputs + length * (inputs - guess.inputs)
            history = self.past_windows(past, trial_inputs)
            trial = self._merit(
                trial_states, trial_inputs, self.model.predict(trial_states[:-1], trial_inputs, history), reference, circles
            )
            # the last term forgives what rounding takes once nothing is left to gain
            if trial <= now - ARMIJO * length * expected + 1e-10 * abs(now):
                return length
            length *= 0.5
        return length
