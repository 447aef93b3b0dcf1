"""Sequential quadratic programming: linearise, fill the QP, solve it, step.

One pass per period from the shifted last solution is the real-time iteration; more passes converge
to a Karush-Kuhn-Tucker point of the nonlinear problem. Long steps end in a line search
(`line_search.py`). Passes to convergence that make little progress use the exact Hessian
(`exact_hessian.py`), unless the model has an input history.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from kmpc_lite.control.nmpc.choose_solver import DEFAULT_SOLVER, MakeSolver, choose_solver
from kmpc_lite.control.nmpc.fill_qp import Linearized, QPFiller
from kmpc_lite.control.nmpc.line_search import (
    Direction,
    LineSearch,
    Penalties,
    Step,
    predict_stages,
    short_limits,
)
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import QPSolution, QPStatus
from kmpc_lite.control.nmpc.sqp_state import Progress, SQPResult, SQPState
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.nmpc.trajectory import Trajectory, command_windows
from kmpc_lite.control.nmpc.warm_start import WarmStart
from kmpc_lite.control.options import SolverOptions, StepOptions, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.recent_times import longest_lately
from kmpc_lite.control.world.half_planes import keep_out
from kmpc_lite.types import INPUTS, STATES, Array


class SQP:
    """Solver of one navigation problem; holds the memory that a pass needs, and none beyond a call.

    Parameters
    ----------
    problem : NavigationProblem
        What is asked; its weights are those that are used.
    history : int
        Past commands that models depend on, L.
    iterations : int
        Passes per call at the most; 1 is the real-time iteration.
    tolerance : float
        Change of the trajectory below which passes end [m, rad, m/s, rad/s].
    slots : int
        Half-planes per stage: the nearest of all obstacles and sides of the area.
    options : SolverOptions, optional
        Settings of the QP solver and of the passes.
    step : StepOptions, optional
        How far the model may contradict the plan of one pass before more are made.
    solver : str or callable
        ``"osqp"``, a name that qpsolvers knows, or what sets up a solver for a QP.
    clock : callable
        Gives the time [s] that deadlines are on.
    ways : bool
        Whether the ways between the stages are kept out of circles, too: of a round robot.

    Raises
    ------
    ProblemError
        For a solver that is not installed.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        history: int,
        *,
        iterations: int = 1,
        tolerance: float = 1e-5,
        slots: int = 5,
        options: SolverOptions | None = None,
        step: StepOptions | None = None,
        solver: str | MakeSolver = DEFAULT_SOLVER,
        clock: Callable[[], float] = perf_counter,
        ways: bool = False,
    ) -> None:
        self.options = options = SolverOptions() if options is None else options
        self.problem, self.clock, self.ways = problem, clock, ways
        self.iterations, self.tolerance = iterations, tolerance
        exact_hessian = iterations > 1 and not history  # what a command bends later is left out
        slots *= 1 if problem.footprint is None else 2  # at either end of what is not round
        self.qp = NavigationQP(problem, history, slots, exact_hessian, options, ways)
        settings = options.converged if iterations > 1 else options.one_pass(history)
        self.workspace = choose_solver(solver, self.qp, settings)
        self.keep_out = keep_out(problem, slots, ways)
        self._filler = QPFiller(self.qp, self.keep_out, exact_hessian, options)
        self.warm_start = WarmStart(problem, self.qp, options)
        self._search = LineSearch(self.qp, self.keep_out, options.armijo, clock)
        self._u_min, self._u_max, _, _ = problem.bounds
        self._rates = RateLimit(problem)
        self._short, self._straight = short_limits(problem, options)
        self._contradicted = (step or StepOptions()).accepted_defect * unit_length(problem)
        self._tolerated_depth = options.constraint_tolerance * unit_length(problem)

    def solve(self, state: SQPState, guess: Trajectory, task: Task, passes: int = 1) -> SQPResult:
        """Run the passes from a guess whose first state is the present one.

        At least one pass is made; another only if it is expected to end before the deadline. The QP
        solver is stopped there.

        Parameters
        ----------
        state : SQPState
            Updated.
        guess : Trajectory
            Where to linearise first.
        task : Task
            What is asked.
        passes : int
            How many a real-time iteration makes at the most: one from a warm start, more from a
            guess that knows little.
        """
        self.workspace.restart()
        run = self._begin(guess, task, passes)
        while run.passes < run.limit:
            begin = self.clock()
            if run.passes and begin + run.longest_pass > task.deadline:
                run.reason = run.reason or "time budget"
                break
            self._pass(state, run, task, begin)
            watched = task.tightening is not None
            if run.limit == 1 and watched and run.defect > self._contradicted:
                # what the model contradicts is linearised again where the plan has come to; without
                # margins nothing but the contradiction would keep a far goal from an obstacle
                run.limit = self.options.contradicted_passes
            if run.status is QPStatus.FAILED or self._has_ended(run, task):
                break
        if (
            self.iterations > 1
            and run.passes == run.limit
            and run.status is not QPStatus.FAILED
            and run.step > run.tolerance
            and run.length > run.shortest
        ):
            run.reason = run.reason or f"not converged in {run.passes} passes"
        return SQPResult(
            run.guess,
            run.status,
            run.passes,
            run.step,
            run.defect,
            run.next_state,
            run.timing,
            run.reason,
        )

    def _begin(self, guess: Trajectory, task: Task, passes: int) -> Progress:
        """Prepare the passes of a call."""
        if self._rates.active:
            self.qp.set_last_command(task.last)
            guess = replace(guess, inputs=self._rates.in_reach(guess.inputs, task.last))
        limit, tolerance = passes, self.options.cold_tolerance
        if self.iterations > 1:
            limit, tolerance = self.iterations, self.tolerance
        penalty, cost = float(self.problem.slack_weights[0]), self.qp.cost
        if self.ways:
            # a long step that is given up costs more than the usual weight
            penalty *= self.options.penalty_growth
        cost.set_slack_penalty(penalty)
        cost.set_terminal_share(task.terminal_share)
        return Progress(
            guess,
            limit,
            tolerance,
            self.options.shortest_step if limit == 1 else self.options.shortest_converging_step,
            Penalties(penalty),
            # the QP is solved around the robot, so that its relative tolerance does not depend on
            # where the map has its origin
            guess.states[0] * (1.0, 1.0, 0.0),
            guess.states[0],
        )

    def _pass(self, state: SQPState, run: Progress, task: Task, begin: float) -> None:
        """Linearise at the guess, solve, and step to a better guess."""
        guess = run.guess
        past = command_windows(self.qp.history, task.past, guess.inputs)
        lin = task.model.linearize(guess.states[:-1], guess.inputs, past)
        linearized = self.clock()
        data = self._filler.fill(run, task, lin)
        filled = self.clock()
        limit = None
        if task.deadline < math.inf:
            left = task.deadline - filled - state.search_time
            limit = max(left, self.options.least_solve_time)
        qp = self.qp
        warm = qp.pack(data.local, guess.inputs, data.violation)
        solution = self.workspace.solve(
            qp.q,
            qp.lower,
            qp.upper,
            qp.A.data,
            warm,
            guess.duals,
            Px=data.cost,
            time_limit=limit,
        )
        solved = self.clock()
        run.passes += 1
        run.status, run.reason = solution.status, solution.reason
        if solution.status is not QPStatus.FAILED:
            self._step(run, task, data, solution, warm)
        end = self.clock()
        timing = run.timing
        timing["linearise"] += linearized - begin
        timing["fill"] += filled - linearized
        timing["solve"] += solved - filled
        timing["search"] += end - solved
        run.longest_pass = max(run.longest_pass, end - begin)
        state.search_time = longest_lately(state.search_time, end - solved)

    def _step(
        self, run: Progress, task: Task, data: Linearized, solution: QPSolution, warm: Array
    ) -> None:
        """Take the QP's solution, or a part of the step to it, as the next guess."""
        before, value = run.guess, data.lin.value
        found, slack = self._found(run, task, data, solution)
        is_only_pass = run.limit == 1
        if (
            is_only_pass
            and solution.status is QPStatus.SOLVED
            and self._is_short(solution.x - warm)
        ):
            # here the linearisation holds, and there is nothing to search
            run.guess, run.defect = found, solution.primal_residual
            change = found.inputs[0] - before.inputs[0]
            run.next_state = value[0] + data.lin.B[0] @ change
            return
        predicted = predict_stages(found, task)
        if is_only_pass and (np.abs(predicted - found.states[1:]) <= self._straight).all():
            step = Step(found, run.length, predicted)
        else:
            direction = Direction(
                before, found, value, predicted, slack, data.violation, run.margins
            )
            step = self._search.search(run.penalties, direction, task, run.shortest)
        run.guess, run.length, predicted = step
        run.defect = float(np.abs(predicted - run.guess.states[1:]).max())
        run.next_state = predicted[0]
        if not is_only_pass:
            run.step = max(
                float(np.abs(run.guess.states - before.states).max()),
                float(np.abs(run.guess.inputs - before.inputs).max()),
            )

    def _found(
        self, run: Progress, task: Task, data: Linearized, solution: QPSolution
    ) -> tuple[Trajectory, Array]:
        """Trajectory and slacks (N,) of a QP's solution, its commands within bounds and reach."""
        states, inputs, slack = self.qp.unpack(solution.x, data.local[0])
        states += run.origin
        if self._rates.active:
            least, most = self._rates.first(task.last)
            np.maximum(np.minimum(inputs[0], most, out=inputs[0]), least, out=inputs[0])
        np.maximum(np.minimum(inputs, self._u_max, out=inputs), self._u_min, out=inputs)
        if self.qp.problem.limits_wheels:
            inputs = self.qp.problem.within_bounds(inputs)
        return Trajectory(states, inputs, solution.y), slack

    def _is_short(self, change: Array) -> bool:
        """Whether a change of the QP's variables moves every state and command by little."""
        moved = change[: (STATES + INPUTS) * self.qp.horizon]
        return bool(np.logical_and.reduce(np.abs(moved, out=moved) <= self._short))

    def _has_ended(self, run: Progress, task: Task) -> bool:
        """Whether the passes have converged, or get nowhere: the accuracy of the QP is met."""
        if run.step > run.tolerance and run.length > run.shortest:
            return False
        if self.iterations == 1 or not self._is_penalty_too_weak(run, task):
            return True
        run.penalties.slack *= self.options.penalty_growth
        self.qp.cost.set_slack_penalty(run.penalties.slack)
        return False

    def _is_penalty_too_weak(self, run: Progress, task: Task) -> bool:
        """Whether a converged plan stands in an obstacle though it need not."""
        margins = run.margins
        inside = self.keep_out.penetration(run.guess.states, task.things, task.solids, margins)
        depth = float(inside.max())
        before, run.pressed_depth = run.pressed_depth, depth
        return (
            run.penalties.slack < self.options.largest_penalty
            and depth > self._tolerated_depth
            and depth < 0.5 * before
        )
