"""Sequential quadratic programming: linearise, fill the QP, solve it, step.

One pass per period from the shifted last solution is the real-time iteration. Another pass follows
while the model contradicts the plan by more than its tolerance, and time is left; passes to
convergence go on until the plan changes by less than theirs, at a Karush-Kuhn-Tucker point of the
nonlinear problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import Around, Iterate, KeepOut, PlanMargins
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.nmpc.qp import NavigationQP, Trajectory, command_windows
from kmpc_lite.control.nmpc.qp_solvers import (
    DEFAULT_SOLVER,
    MakeSolver,
    QPData,
    QPStatus,
    choose_solver,
)
from kmpc_lite.control.options import OSQPOptions, SolverOptions, StepOptions, fastest, unit_length
from kmpc_lite.control.plan import Task
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.wheels import Car
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.types import Array

LEAST_SOLVE_TIME = 5e-5
"""Time that a QP gets even past a deadline [s]: the iterate that it starts from is no plan."""
MOST_PASSES = 10  # of a real-time iteration whose plan the model contradicts
TOLERATED = 0.3
"""Contradiction that asks for another pass, as a share of the largest one that is driven."""
FAR_TURN = 0.6
"""Turn in a period [rad] from which on QPs are solved thoroughly: stopped early, they let a robot
that drives far in a period cut into what it passes."""
THOROUGH = 5
"""Times the iterations for such robots, and for those with input history or limited changes: what
the robot still does of past commands it cannot take back, and multipliers become large. The plans
of robots that turn far may be contradicted by as many times less."""
CONVERGED = OSQPOptions(
    tolerance=1e-7, max_iter=4000, alpha=1.6, adaptive_rho=True, scaling=10, check_termination=25
)
"""For passes to convergence, whose steps become as small as their tolerance."""
EXACT_PENALTY = 10.0
"""Passes to convergence weigh slack by this many times more: above the multipliers of all that a
plan can pass by, so that slack is used only if there is no way without. One pass a period does
with less, which is solved sooner: the next period mends what it leaves."""
LEAST_SHARE = 0.1  # least share of a step that a pass goes


@dataclass(slots=True, eq=False)
class SQPResult:
    """How far the passes of a call have come, and where they ended."""

    trajectory: Trajectory  # the iterate; the start before the first pass
    status: QPStatus = QPStatus.FAILED  # of the last QP
    passes: int = 0
    step: float = math.inf  # largest change of the last pass [m, rad, m/s, rad/s]
    defect: float = math.inf
    """How far the model contradicts the trajectory over one period [m, rad]."""
    timing: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("linearise", "fill", "solve"), 0.0)
    )
    """Seconds by phase."""
    reason: str = ""  # why the passes ended early, or the QP failed; empty if all is well


class SQP:
    """Solver of one navigation problem; holds the memory that a pass needs, and none beyond a call.

    `problem`: what is asked; its weights are those that are used. `history`: past commands that
    models depend on, L. `iterations`: passes per call until the plan has settled; 1 is the
    real-time iteration. `tolerance`: change of the trajectory below which it has settled [m, rad,
    m/s, rad/s]. `slots`: half-planes per stage: the nearest of all obstacles and sides of the area.
    `options`: settings of the QP solver and of the passes. `step`: how far the model may contradict
    a plan. `solver`: ``"osqp"``, a name that qpsolvers knows, or what sets up a solver for a QP.
    `clock`: gives the time [s] that deadlines are on. Raises ProblemError for a solver that is not
    installed.
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
    ) -> None:
        options = SolverOptions() if options is None else options
        step = StepOptions() if step is None else step
        self.problem, self.clock = problem, clock
        self.iterations, self.tolerance = iterations, tolerance
        slots *= 1 if problem.footprint is None else 2  # at either end of what is not round
        penalties = problem.slack_weights * (EXACT_PENALTY if iterations > 1 else 1.0, 1.0)
        soft = replace(problem, slack_weights=penalties)
        self.qp = NavigationQP(soft, history, slots)
        self.fill = FillQP(problem, slots)
        turns_far = problem.dt * fastest(problem)[1] > FAR_TURN
        settings = options.real_time
        if iterations > 1:
            settings = CONVERGED
        elif history or turns_far or problem.limits_changes:
            longest = settings.max_iter
            settings = replace(
                settings,
                max_iter=THOROUGH * longest,
                adaptive_rho=True,
                adaptive_rho_interval=longest,
            )
        self.workspace = choose_solver(solver, self.qp, settings)
        self.tolerated = TOLERATED * step.accepted_defect * unit_length(problem)
        if turns_far:
            self.tolerated /= THOROUGH
        self._couples = problem.limits_wheels or not problem.wheels.turns_on_the_spot
        self._rates, self._wanted = RateLimit(problem), np.zeros((problem.horizon, 2))
        self._u_min, self._u_max, _, _ = problem.bounds

    def solve(self, guess: Trajectory, task: Task, least: int = 1) -> SQPResult:
        """Run the passes from a guess whose first state is the present one.

        At least one pass is made; another only if it is expected to end before the deadline. The QP
        solver is stopped there.

        `guess`: where to linearise first. `task`: what is asked. `least`: fewest passes: a guess
        that is no plan is linearised at twice.
        """
        self.workspace.restart()
        if self._rates.active:
            guess = guess._replace(inputs=self._rates.in_reach(guess.inputs, task.last))
        self.qp.cost.set_terminal_share(task.terminal_share)
        self._steer(task, guess.states[0])
        self.qp.set_last_command(task.last)
        run = SQPResult(guess)
        share, longest = 1.0, 0.0
        while True:
            begin, before = self.clock(), run.step
            self._pass(run, task, begin, share)
            ended = run.passes >= least and self._has_ended(run)
            if run.status is QPStatus.FAILED or ended:
                return run
            now = self.clock()
            longest = max(longest, now - begin)
            if now + longest > task.deadline:
                run.reason = run.reason or "time budget"
                return run
            if run.step >= before:
                # going there and back: the half of it lies between
                share = max(0.5 * share, LEAST_SHARE)

    def _steer(self, task: Task, here: Array) -> None:
        """Write a car's commands along its reference, and gear and curvatures of each stage."""
        car, dt = self.problem.wheels, self.problem.dt
        if isinstance(car, Car):
            braking = dt * float(self.problem.du_max[0])
            gears = car.gears(task.reference, here, task.last, braking)
            # what is commanded now leads to poses that come later
            late = min(task.late, self.qp.horizon - 1)
            wanted = car.commands(task.reference[late:], task.curvature, dt)
            self._wanted = wanted = np.concatenate([wanted, wanted[-1:].repeat(late, axis=0)])
            self.qp.set_gears(gears, car.curvatures(wanted, task.curvature, dt))
            self.qp.set_input_reference(self.problem.within_bounds(wanted), car.waits(wanted))

    def _has_ended(self, run: SQPResult) -> bool:
        """Whether the model agrees with the plan, and it has settled; or passes are used up."""
        if self.iterations == 1:
            return run.defect <= self.tolerated or run.passes >= MOST_PASSES
        if run.step <= self.tolerance:
            return True
        if run.passes < self.iterations:
            return False
        run.reason = run.reason or f"not converged in {run.passes} passes"
        return True

    def _pass(self, run: SQPResult, task: Task, begin: float, share: float) -> None:
        """Linearise at the guess, solve, and go a share of the way to what the QP found."""
        guess, qp = run.trajectory, self.qp
        past = command_windows(qp.history, task.past, guess.inputs)
        lin = task.model.linearize(guess.states[:-1], guess.inputs, past)
        linearized = self.clock()
        self.fill(qp, task, lin, guess.states, guess.inputs)
        filled = self.clock()
        limit = None
        if task.deadline < math.inf:
            # asking the model about the plan takes no longer than linearising it did
            limit = max(task.deadline - filled - (linearized - begin), LEAST_SOLVE_TIME)
        bends = task.to_goal or qp.cost.terminal_share != 1.0
        told = qp.q, qp.lower, qp.upper, qp.A.data, qp.numbers.start, guess.duals
        solution = self.workspace.solve(QPData(*told, qp.P.data if bends else None), limit)
        solved = self.clock()
        run.passes += 1
        run.status, run.reason = solution.status, solution.reason
        if solution.status is not QPStatus.FAILED:
            states, inputs = qp.unpack(solution.x, guess.states[0])
            found = Trajectory(states, self._in_bounds(inputs, task), solution.y)
            self._go(run, task, found, share)
        timing = run.timing
        timing["linearise"] += linearized - begin
        timing["fill"] += filled - linearized
        timing["solve"] += solved - filled

    def _go(self, run: SQPResult, task: Task, found: Trajectory, share: float) -> None:
        """Take a share of the step to a QP's solution, and ask the model about it."""
        guess = run.trajectory
        states, inputs = found.states - guess.states, found.inputs - guess.inputs
        run.step = max(_largest(states), _largest(inputs))
        if share < 1.0:
            found = found._replace(
                states=guess.states + share * states, inputs=guess.inputs + share * inputs
            )
        past = command_windows(task.model.history, task.past, found.inputs)
        predicted = task.model.predict(found.states[:-1], found.inputs, past)
        run.trajectory = found
        run.defect = _largest(predicted - found.states[1:])

    def _in_bounds(self, inputs: Array, task: Task) -> Array:
        """Commands (N, 2) of a QP's solution within bounds, and within reach of the last one."""
        if self._rates.active:
            least, most = self._rates.first(task.last)
            np.maximum(np.minimum(inputs[0], most, out=inputs[0]), least, out=inputs[0])
        np.maximum(np.minimum(inputs, self._u_max, out=inputs), self._u_min, out=inputs)
        car = self.problem.wheels
        if isinstance(car, Car):
            inputs = car.steered(inputs, self._wanted, task.curvature, self.problem.dt)
        return self.problem.within_bounds(inputs) if self._couples else inputs


def _largest(values: Array) -> float:
    """Largest size of any value; NaN if one is."""
    return float(np.maximum.reduce(np.abs(values), axis=None))


def keep_out(problem: NavigationProblem, slots: int) -> KeepOut:
    """What a robot's outline stays out of: obstacles, and the outside of the area.

    Obstacles are grown by the radius of the outline's circles and the problem's margin.
    """
    _, _, x_min, x_max = problem.bounds
    sides = [
        (axis, sign, sign * bound)
        for axis in (0, 1)
        for sign, bound in ((1.0, x_min[axis]), (-1.0, x_max[axis]))
        if np.isfinite(bound)
    ]
    normals = np.zeros((len(sides), 2))
    for row, (axis, sign, _) in zip(normals, sides, strict=True):
        row[axis] = sign
    return KeepOut(
        distance=float(problem.body_radius + problem.margin),
        dt=problem.dt,
        range=math.inf if problem.sensor_range is None else problem.sensor_range,
        side_normals=normals,
        side_offsets=np.array([offset for _, _, offset in sides]),
        directions=2 if problem.footprint is None else 3,
        slots=slots,
    )


class FillQP:
    """Writes the QP of a pass: dynamics, half-planes and cost, around the robot.

    `problem`: bounds, outline, margin. `slots`: half-planes per stage.
    """

    def __init__(self, problem: NavigationProblem, slots: int) -> None:
        self.keep_out = keep_out(problem, slots)
        self._footprint = problem.footprint
        circles = 1 if problem.footprint is None else len(problem.footprint.circles)
        count = circles * problem.horizon
        self._nothing = np.empty((count, 0)), np.empty((count, 0, self.keep_out.directions))

    def __call__(
        self, qp: NavigationQP, task: Task, lin: Linearization, states: Array, inputs: Array
    ) -> None:
        """Write the QP at a guess (N + 1, 3) and (N, m), linearised there."""
        points = places_of(self._footprint, states[1:])
        gaps, away = self._nothing
        if task.around.nearby is not None:
            body = None if self._footprint is None else (self._footprint, states[1:])
            gaps, away = task.around.nearby.measure(points, body)
        margins, felt = None, task.felt
        if task.margins is not None and felt is not None:
            path = task.path_clearance
            margins = PlanMargins(
                noise=felt.tube,
                widest=felt.widest,
                far_clearance=task.margins.far_clearance,
                side_margin=task.margins.side_margin,
                path_clearance=(
                    np.full(len(inputs), path) if isinstance(path, float) else np.ravel(path)
                ),
            )
        plan = Iterate(states, inputs, task.reference, speeds(inputs), task.to_goal)
        around = Around(task.around.things, points, gaps, away)
        library.fill(self.keep_out, margins, qp.numbers, lin, plan, around)
        qp.P.data[qp.turn_places] = qp.numbers.turn
