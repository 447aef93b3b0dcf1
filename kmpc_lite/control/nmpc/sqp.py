"""Sequential quadratic programming: linearise, fill, solve, step.

One pass per period from the shifted last solution is the real-time iteration; more passes converge
to a Karush-Kuhn-Tucker point of the nonlinear problem. Long steps end in a line search on an exact
L1 merit function: full steps of the Gauss-Newton QP, which knows no curvature of the dynamics, go
back and forth between two plans on one state in ten. Passes to convergence look at it where they
get on badly (`curvature.py`), as far as the model has no input history.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from kmpc_lite.control.margins.tightening import Tightening
from kmpc_lite.control.nmpc.exact_hessian import hessians
from kmpc_lite.control.nmpc.osqp_workspace import OSQPWorkspace, QPStatus
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.obstacles.circles import KeepOut
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

REAL_TIME: dict[str, Any] = {
    "eps_abs": 1e-3,
    "eps_rel": 1e-3,
    "max_iter": 60,
    "rho": 1.0,
    "alpha": 1.4,
    "adaptive_rho": 0,
    "scaling": 0,
    "check_termination": 10,
}
CONVERGED: dict[str, Any] = {
    "eps_abs": 1e-7,
    "eps_rel": 1e-7,
    "max_iter": 4000,
    "rho": 1.0,
    "adaptive_rho": 1,
}
"""OSQP's settings for one pass per period, and for passes to convergence."""

COLD_PASSES, NEW_WAY_PASSES = 10, 2
"""Passes without a warm start, at most: the first linearisation, at rest, sees no way to steer;
along a new way it does."""
COLD_TOLERANCE = 0.02
GAUSS_NEWTON_PASSES = 10
"""From this pass to convergence on the curvature of dynamics and circles is looked at in every
other one, before that only after a shortened step: where constraints settle everything Gauss-Newton
is there in five passes, and convex Hessians need fifty."""
SHORT = (0.1, 0.4)
"""A real-time iteration takes a step that changes no state [m, rad] and no command [m/s, rad/s] by
more without a line search."""
STRAIGHT = 5e-3
"""Nor one after which the model contradicts the plan by no more than this over a period [m,
rad]."""
ARMIJO = 1e-4
SHORTEST_STEP = {"real time": 0.1, "converged": 1e-3}
"""Where a line search ends: in real time what is left waits for the next period, which knows
more."""
PENALTY_GROWTH = 10.0
PENALTY_LIMIT = 1e5
"""To convergence, the linear penalty grows by this factor, up to this weight, while that halves
what obstacles are entered by."""
VIOLATION = 1e-5
"""How far inside an obstacle a converged plan may stand [m] before the penalty grows."""
FAR = 0.1
"""Where a plan has this much room beyond the widest margins [m], those do as well as its own."""
SIDE_MARGIN = 0.01
"""What is kept from the sides of the area where margins are on [m]."""
MIN_SOLVE_TIME = 5e-5
"""OSQP is given at least this long [s], even past a deadline: the iterate it starts from is worth
nothing."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States (N + 1, 3), commands (N, 2) and the QP's multipliers (m,): an iterate, and a warm start."""

    states: Array
    inputs: Array
    duals: Array


@dataclass(frozen=True, eq=False)
class Task:
    """What one call of the SQP is asked."""

    reference: Array
    """(N + 1, 3) states to steer for."""
    circles: Array
    """(M, 5) rows x, y, radius, vx, vy."""
    past: Array
    """(L, 2) commands already sent, oldest first."""
    last: Array
    """(2,) the command sent last, zero of a robot that stands."""
    deadline: float = np.inf
    """When the answer must be there, on the clock of the SQP [s]."""


@dataclass(frozen=True, eq=False)
class SQPResult:
    """Where the passes ended."""

    trajectory: Trajectory
    status: QPStatus
    passes: int
    step: float
    """Largest change of the last pass [m, rad, m/s, rad/s]; infinite where only one was asked
    for."""
    defect: float
    """How far the model contradicts the trajectory over one period [m, rad]."""
    next_state: Array
    """(3,) what the model expects after the first command."""
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
    tightening : Tightening, optional
        Margins beyond the radii for what the model does not know; computed at each linearisation
        and held during the pass.
    clock : callable
        Gives the time [s] that deadlines are on.
    """

    def __init__(
        self,
        model: KoopmanModel,
        problem: NavigationProblem,
        iterations: int,
        tolerance: float,
        slots: int,
        tightening: Tightening | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        self.model, self.problem, self.tightening = model, problem, tightening
        self.iterations, self.tolerance, self.clock = iterations, tolerance, clock
        # what a command bends many periods later is left out
        self._curved = iterations > 1 and not model.history
        self.qp = NavigationQP(problem, model.history, slots, self._curved)
        settings = REAL_TIME if iterations == 1 else CONVERGED
        self.workspace = OSQPWorkspace(
            self.qp.P, self.qp.q, self.qp.A, self.qp.lower, self.qp.upper, **settings
        )
        self.keep_out = KeepOut(problem, slots)
        self._u_min, self._u_max, _, _ = problem.bounds
        self.largest_command = float(np.maximum(self._u_max, -self._u_min).max())
        self._rates = RateLimit(problem)
        self._dynamics_penalty, self._pressed_violation = 0.0, np.inf
        self._search_time = 0.0

    def at_rest(self, x: Array) -> Trajectory:
        """Return the trajectory of a robot that stands at x: a cold start."""
        n = self.problem.horizon
        return Trajectory(np.tile(x, (n + 1, 1)), np.zeros((n, 2)), self.qp.duals_in_the_open())

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
        return np.lib.stride_tricks.sliding_window_view(
            commands, self.model.history, axis=0
        ).transpose(0, 2, 1)

    def along(self, reference: Array, x: Array) -> Trajectory:
        """Return the trajectory of a robot that follows a reference (N + 1, 3) from where it is, (3,)."""
        states = reference.copy()
        states[0] = x
        steps = np.diff(states, axis=0)
        forward = np.cos(states[:-1, 2]) * steps[:, 0] + np.sin(states[:-1, 2]) * steps[:, 1]
        inputs = np.column_stack([forward, steps[:, 2]]) / self.problem.dt
        return Trajectory(
            states, np.clip(inputs, self._u_min, self._u_max), self.qp.duals_in_the_open()
        )

    def solve(self, guess: Trajectory, task: Task, passes: int = 1) -> SQPResult:
        """Run the passes from a guess whose first state is the present one.

        At least one pass is made; another only if it is expected to end before the deadline. OSQP
        is stopped there.

        Parameters
        ----------
        guess : Trajectory
            Where to linearise first.
        task : Task
            What is asked.
        passes : int
            How many a real-time iteration makes at the most: one from a warm start, more from a
            guess that knows little.
        """
        timing = {"linearise": 0.0, "fill": 0.0, "solve": 0.0, "search": 0.0}
        if self._rates.active:
            self.qp.set_last_command(task.last)
            guess = replace(guess, inputs=self._rates.in_reach(guess.inputs, task.last))
            least, most = self._rates.first(task.last)
        to_convergence = self.iterations > 1
        limit, tolerance = (
            (self.iterations, self.tolerance) if to_convergence else (passes, COLD_TOLERANCE)
        )
        shortest = SHORTEST_STEP["real time" if limit == 1 else "converged"]
        self._dynamics_penalty, self._pressed_violation = 0.0, np.inf
        self.qp.set_slack_penalty(float(self.problem.slack_weights[0]))
        # the QP is solved around the robot, so that its relative tolerance does not depend on where
        # the map has its origin
        origin = guess.states[0] * (1.0, 1.0, 0.0)
        reference = task.reference - origin
        next_state, length = guess.states[0], 0.0
        step, defect, done, status, reason, longest = np.inf, np.inf, 0, QPStatus.FAILED, "", 0.0
        while done < limit:
            t0 = self.clock()
            if done and t0 + longest > task.deadline:
                reason = reason or "time budget"
                break
            lin = self.model.linearize(
                guess.states[:-1], guess.inputs, self.past_windows(task.past, guess.inputs)
            )
            t1 = self.clock()
            gaps, normals = self.keep_out.gaps(guess.states, task.circles)
            margins: Array | float = 0.0
            if self.tightening is not None:
                # nothing is hit at the sides of the area: what keeps the robot from creeping out is
                # enough for them
                margins = np.empty(gaps.shape)
                margins.fill(SIDE_MARGIN)
                count = self.keep_out.obstacle_count(task.circles)
                if count and gaps[:, :count].min() < self.tightening.widest + FAR:
                    margins[:, :count] = self.tightening.margins(
                        lin, guess.states, guess.inputs, normals[:, :count]
                    )
                elif count:
                    margins[:, :count] = self.tightening.widest
                gaps -= margins
            violation = np.maximum(-gaps.min(axis=1, initial=0.0), 0.0)
            local = guess.states - origin
            normals, offsets = self.keep_out.half_planes(local, gaps, normals)
            self.qp.fill(
                lin._replace(value=lin.value - origin),
                local,
                guess.inputs,
                reference,
                normals,
                offsets,
            )
            if self._curved:
                stages, terminal = self.qp.stage_cost, self.qp.terminal_cost
                if done and (length < 1.0 or (done >= GAUSS_NEWTON_PASSES and done % 2 == 0)):
                    bends = self.keep_out.bends(guess.states, task.circles)
                    stages, terminal = hessians(
                        self.model, self.qp, guess.states, guess.inputs, guess.duals, normals, bends
                    )
                self.qp.fill_cost(stages, terminal, local, guess.inputs)
                self.workspace.change_cost(self.qp.P.data)
            t2 = self.clock()
            if task.deadline < np.inf:
                self.workspace.limit_time(
                    max(task.deadline - t2 - self._search_time, MIN_SOLVE_TIME)
                )
            warm = self.qp.pack(local, guess.inputs, violation)
            solution = self.workspace.solve(
                self.qp.q, self.qp.lower, self.qp.upper, self.qp.A.data, warm, guess.duals
            )
            t3 = self.clock()
            done += 1
            status, reason = solution.status, solution.reason
            if status is not QPStatus.FAILED:
                states, inputs, slack = self.qp.unpack(solution.x, local[0])
                states += origin
                if self._rates.active:
                    np.maximum(np.minimum(inputs[0], most, out=inputs[0]), least, out=inputs[0])
                np.maximum(np.minimum(inputs, self._u_max, out=inputs), self._u_min, out=inputs)
                found = Trajectory(states, inputs, solution.y)
                before = guess
                if limit == 1 and status is QPStatus.SOLVED and self._is_short(solution.x - warm):
                    # here the linearisation holds, and there is nothing to search
                    guess, defect = found, solution.primal_residual
                    next_state = lin.value[0] + lin.B[0] @ (found.inputs[0] - before.inputs[0])
                else:
                    predicted = self._predicted(found, task)
                    if limit == 1 and np.abs(predicted - found.states[1:]).max() <= STRAIGHT:
                        guess = found
                    else:
                        guess, length, predicted = self._line_search(
                            before,
                            found,
                            predicted,
                            slack,
                            lin.value,
                            violation,
                            margins,
                            task,
                            shortest,
                        )
                    defect, next_state = (
                        float(np.abs(predicted - guess.states[1:]).max()),
                        predicted[0],
                    )
                if limit > 1:
                    step = max(
                        float(np.abs(guess.states - before.states).max()),
                        float(np.abs(guess.inputs - before.inputs).max()),
                    )
            t4 = self.clock()
            for phase, seconds in zip(timing, (t1 - t0, t2 - t1, t3 - t2, t4 - t3), strict=True):
                timing[phase] += seconds
            longest, self._search_time = (
                max(longest, t4 - t0),
                max(t4 - t3, 0.95 * self._search_time),
            )
            if status is QPStatus.FAILED:
                break
            # a line search that gets nowhere has met the accuracy of the QP
            if step <= tolerance or length <= shortest:
                if not (to_convergence and self._penalty_too_weak(guess, margins, task)):
                    break
                self.qp.set_slack_penalty(PENALTY_GROWTH * self.qp.slack_penalty)
        if (
            to_convergence
            and done == limit
            and status is not QPStatus.FAILED
            and step > tolerance
            and length > shortest
        ):
            reason = reason or f"not converged in {done} passes"
        return SQPResult(guess, status, done, step, defect, next_state, timing, reason)

    def _predicted(self, trajectory: Trajectory, task: Task) -> Array:
        """What the model says of stages 1 to N, (N, 3), each from the stage before."""
        w = self.model.dictionary.inputs(
            trajectory.inputs, self.past_windows(task.past, trajectory.inputs)
        )
        return self.model.advance(trajectory.states[:-1], w)

    def _is_short(self, change: Array) -> bool:
        """Whether a change of the QP's variables moves every state and command by little."""
        change = np.abs(change, out=change)
        states, inputs = (
            change[: self.qp.input_columns[0, 0]],
            change[self.qp.input_columns[0, 0] : self.qp.slack_columns[0]],
        )
        return bool(np.maximum.reduce(states) <= SHORT[0] and np.maximum.reduce(inputs) <= SHORT[1])

    def _penalty_too_weak(self, found: Trajectory, margins: Array | float, task: Task) -> bool:
        """Whether a converged plan stands in an obstacle because the linear penalty is too weak, and not because it must."""
        violation = float(self.keep_out.penetration(found.states, task.circles, margins).max())
        before, self._pressed_violation = self._pressed_violation, violation
        return (
            self.qp.slack_penalty < PENALTY_LIMIT
            and violation > VIOLATION
            and violation < 0.5 * before
        )

    def _penalty(self, violation: Array) -> float:
        """Exact penalty on the violation of each stage (N,) [m]."""
        return float(
            self.qp.slack_penalty * violation.sum()
            + self.problem.slack_weights[1] * (violation @ violation)
        )

    def _merit(self, objective: float, violation: Array, defect: float) -> float:
        """Exact merit function: objective, L1 and L2 penalties on obstacles, L1 on what the dynamics lack."""
        return objective + self._penalty(violation) + self._dynamics_penalty * defect

    def _line_search(
        self,
        guess: Trajectory,
        found: Trajectory,
        predicted: Array,
        slack: Array,
        before: Array,
        violation: Array,
        margins: Array | float,
        task: Task,
        shortest: float,
    ) -> tuple[Trajectory, float, Array]:
        """Go from the guess towards what the QP found until the merit function falls enough (Armijo), by halving.

        `predicted` (N, 3) is what the model says of the stages found, and `before` what it said of
        the guess's. Returns the new trajectory, the length of the step in [0, 1], and what the
        model predicts of its stages.
        """
        cost, reference = self.problem.cost, task.reference
        self._dynamics_penalty = max(
            self._dynamics_penalty, 1.1 * float(np.abs(found.duals[self.qp.dynamics_rows]).max())
        )
        defect = float(np.abs(guess.states[1:] - before).sum())
        now = self._merit(cost(guess.states, guess.inputs, reference), violation, defect)
        objective = cost(found.states, found.inputs, reference)
        expected = now - objective - self._penalty(np.maximum(slack, 0.0))
        length, trial = 1.0, found
        while True:
            inside = self.keep_out.penetration(trial.states, task.circles, margins)
            merit = self._merit(
                objective, inside, float(np.abs(predicted - trial.states[1:]).sum())
            )
            # the last term forgives what rounding takes once nothing is left to gain
            if merit <= now - ARMIJO * length * expected + 1e-10 * abs(now) or length <= shortest:
                return trial, length, predicted
            if self.clock() > task.deadline:
                # what a QP stopped at once has left is no direction: the plan stays
                return guess, 0.0, before
            length *= 0.5
            states = guess.states + length * (found.states - guess.states)
            trial = Trajectory(
                states, guess.inputs + length * (found.inputs - guess.inputs), found.duals
            )
            objective, predicted = (
                cost(trial.states, trial.inputs, reference),
                self._predicted(trial, task),
            )
