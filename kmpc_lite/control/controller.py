"""Controller.step: from a measured pose to a command that is safe to send."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.control.estimation.command_history import CommandHistory
from kmpc_lite.control.estimation.pose_age import advance_pose
from kmpc_lite.control.guidance.goal_reference import GoalReference, GoalReferenceState
from kmpc_lite.control.input_checks import POSITION_LIMIT, are_plausible, is_plausible
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.margins import Margins
from kmpc_lite.control.nmpc.choose_solver import DEFAULT_SOLVER
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.sqp import SQP, SQPResult, SQPState
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.nmpc.trajectory import Trajectory, along, at_rest
from kmpc_lite.control.obstacles.scene import Obstacles, Scene
from kmpc_lite.control.options import GuidanceOptions, MarginOptions, StopOptions
from kmpc_lite.control.plan import Plan, PlannedAround, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.safe_stop.backup import Backup, BackupState
from kmpc_lite.control.safe_stop.braking import Braking
from kmpc_lite.control.safe_stop.stop_trajectory import StopTask, StopTrajectories, StopTrajectory
from kmpc_lite.errors import ProblemError
from kmpc_lite.files import SAME_DT
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.guidance.capabilities import Capabilities
    from kmpc_lite.control.guidance.guide import Guide
    from kmpc_lite.control.guidance.state import GuideState
    from kmpc_lite.control.obstacles.solids import Nearby, Solids

OLDEST_POSE = 2.0
"""Of an older pose [s] nothing follows for the present one."""
DEFECT = 0.05
"""How far the model may contradict a plan over one period [m, rad] before its commands are rolled
out anew."""
TOUCH = 0.02
"""How deep such a rolled-out plan may cut into an obstacle [m] and still be driven, the rest being
left to the next pass."""
IN_REACH = 0.3
"""Solids count as far as this beyond the reach of the fastest plan [m]: margins, and a pose that is
not where it was thought."""
GUIDE_SHARE = 1 / 3
"""Share of a time budget after which a search for a way is left to the next step."""
AFTER_SOLVE = 5e-5
"""Time that a step takes after its plan is verified [s]."""


class Controller:
    """Nonlinear model predictive control with a learned bilinear model (paper, alg. 1).

    Parameters
    ----------
    model : KoopmanModel
        Learned by `fit`, or `nominal_unicycle`; its dt must be the problem's.
    problem : NavigationProblem, optional
        The paper's where not given.
    guidance : bool or GuidanceOptions
        Whether to steer along a way around the obstacles, park and hold at the goal, with weights
        that suit a reference. Without it the goal itself is the reference, as in the paper, and the
        problem's weights are used.
    tightening : {"learned", None}
        Whether to keep margins from obstacles beyond the radii for what the model does not know:
        from its noise model, and for the chord between samples. None is the paper.
    risk : float, optional
        Probability that the margins are made for, instead of `MarginOptions.risk` and
        `lagging_risk`.
    adaptation : bool or OnlineAdaptation, optional
        Whether to correct the model while driving where the floor contradicts it: from the measured
        poses and the commands given. Where not given, it runs where there are learned margins and
        the model is continuous. `adaptation.model` is the model now, to be saved. One with options
        of its own must have been made for `model`.
    pose_age : float
        How old the pose is on arrival [s]; it is brought forward with the commands given meanwhile.
    sqp_iterations : int
        Passes per step: 1 is the real-time iteration, more run until the plan changes by less than
        `tolerance`.
    tolerance : float
        See above.
    time_budget : float, optional
        Longest that a step may take [s]. Passes that would not end in time are not begun, and the
        QP solver is stopped; what it has by then is used if it passes the checks (FEASIBLE).
    solver : str
        Solver of the QPs: ``"osqp"``, the fast path, or any name that qpsolvers knows and has
        installed (clarabel, daqp, proxqp, piqp, highs, ...).
    clock : callable
        Gives the time for budget and timing [s].
    obstacle_slots : int
        How many obstacles and sides of the area each stage of the plan can be held away from: the
        nearest ones.

    Raises
    ------
    ProblemError
        For options that contradict each other.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> controller = Controller(nominal_unicycle(0.1))
    >>> plan = controller.step((0.0, 0.0, 0.0), goal=(1.0, 0.0, 0.0))
    >>> plan.status.name, plan.command.round(2) + 0.0
    ('SOLVED', array([0.6, 0. ]))
    """

    def __init__(
        self,
        model: KoopmanModel,
        problem: NavigationProblem | None = None,
        *,
        guidance: bool | GuidanceOptions = True,
        tightening: Literal["learned"] | None = "learned",
        risk: float | None = None,
        adaptation: bool | OnlineAdaptation | None = None,
        pose_age: float = 0.0,
        sqp_iterations: int = 1,
        tolerance: float = 1e-5,
        obstacle_slots: int = 5,
        time_budget: float | None = None,
        solver: str = DEFAULT_SOLVER,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        if not isinstance(model, KoopmanModel):
            raise ProblemError(
                f"model: expected a KoopmanModel, got {type(model).__name__}; KoopmanModel.load(path) reads a file"
            )
        if adaptation is None:
            adaptation = tightening is not None and model.continuous
        self.adaptation = OnlineAdaptation(model) if adaptation is True else adaptation or None
        if self.adaptation is not None and self.adaptation.base is not model:
            raise ProblemError("adaptation: it was made for another model than the controller's")
        # half the time of rk4, and far below what slip does; prediction, verification and fallback
        # share it
        self.model = replace(model, integrator="midpoint")
        self.problem = NavigationProblem() if problem is None else problem
        if abs(model.dt - self.problem.dt) > SAME_DT * self.problem.dt:
            raise ProblemError(
                f"the model's dt is {model.dt:g} s, the problem's {self.problem.dt:g} s; fit the log at the problem's dt, "
                f"or use NavigationProblem(dt={model.dt:g}) or model.with_dt({self.problem.dt:g})"
            )
        for name, value in (("sqp_iterations", sqp_iterations), ("obstacle_slots", obstacle_slots)):
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ProblemError(f"{name}: expected a whole number >= 1, got {value!r}")
        if not (np.isfinite(tolerance) and tolerance > 0):
            raise ProblemError(f"tolerance: expected a number > 0, got {tolerance!r}")
        if not 0.0 <= pose_age <= OLDEST_POSE:
            raise ProblemError(
                f"pose_age: expected a time from 0 to {OLDEST_POSE:g} s, got {pose_age!r}"
            )
        self._pose_age = float(pose_age)
        self._past = CommandHistory(self.problem, model.history, self._pose_age)
        if time_budget is not None and not (np.isfinite(time_budget) and time_budget > 0):
            raise ProblemError(f"time_budget: expected a time > 0 s, got {time_budget!r}")
        self._time_budget, self._clock, self._after_solve = time_budget, clock, AFTER_SOLVE
        if tightening not in (None, "learned"):
            raise ProblemError(f"tightening: expected 'learned' or None, got {tightening!r}")
        margin_options = MarginOptions()
        if risk is not None:
            margin_options = replace(margin_options, risk=risk, lagging_risk=risk)
        self._margin_options = margin_options
        self._margins = Margins(self.model, self.problem, margin_options) if tightening else None
        self._guide: Guide | None = None
        self._capabilities: Capabilities | None = None
        self._guidance_options = GuidanceOptions() if isinstance(guidance, bool) else guidance
        if guidance:
            # here, for its graph search costs as much to import as all the rest
            from kmpc_lite.control.guidance.guide import Guide

            self._guide = Guide(self.problem, self._guidance_options, clock=clock)
        self._sqp = SQP(
            self.problem.with_default_weights(guidance is not False),
            model.history,
            iterations=sqp_iterations,
            tolerance=tolerance,
            slots=obstacle_slots,
            solver=solver,
            clock=clock,
        )
        if time_budget is not None and not self._sqp.workspace.can_be_stopped:
            raise ProblemError(
                f"time_budget: {solver} cannot be stopped in time; use solver='osqp', or no budget"
            )
        self._goal = GoalReference(self.problem)
        self._fallback, self._stops = Backup(self.problem), StopTrajectories(self.problem)
        self._braking = Braking(self.problem, StopOptions())
        self._rates = RateLimit(self.problem)
        u_min, u_max, _, _ = self.problem.bounds
        fastest = max(float(u_max[0]), -float(u_min[0]))
        self._reach = (
            self.problem.horizon * self.problem.dt * fastest
            + self.problem.robot_radius
            + self.problem.margin
            + IN_REACH
        )
        self._surroundings = Scene()
        self._solids: Solids | None = None
        self._nearby: Nearby | None = None
        self._drift = DriftState()
        self._learn_capabilities(adapted=False)
        self.reset()

    def reset(self) -> None:
        """Forget the last plan, the commands sent, the side from which the goal's heading is approached, and what was learned driving."""
        self._last: Trajectory | None = None
        self._past.reset()
        self._goal_state = GoalReferenceState()
        if self._guide is not None:
            from kmpc_lite.control.guidance.state import GuideState

            self._guide_state: GuideState = GuideState()
        if self.adaptation is not None and self.adaptation.counts.models:
            self.update_model(self.adaptation.base)
        if self.adaptation is not None:
            self.adaptation.reset()
        self._backup, self._drift, self._sqp_state = BackupState(), DriftState(), SQPState()

    def _learn_capabilities(self, adapted: bool) -> None:
        """Ask the model what the robot can do; of one that was adapted while driving, only its speeds count."""
        if self._guide is None:
            return
        from kmpc_lite.control.guidance.capabilities import capabilities, drivable_speeds

        if adapted and self._capabilities is not None:
            speeds = drivable_speeds(self.model, self.problem, self._guidance_options)
            self._capabilities = self._capabilities.with_speeds(speeds, self._guidance_options)
        else:
            self._capabilities = capabilities(
                self.model, self.problem, self._margins, self._guidance_options
            )

    def update_model(self, model: KoopmanModel, adapted: bool = False) -> None:
        """Take over another model of the same robot between two steps: what `adaptation` gives while driving.

        Parameters
        ----------
        model : KoopmanModel
            With the same period, and as long an input history.
        adapted : bool
            Whether it is the one before with gains learned while driving: these tell of the robot's
            speeds, and nothing of its turning centre or the noise of its pose.

        Raises
        ------
        ProblemError
            For another period, or another length of input history.
        """
        if (
            abs(model.dt - self.problem.dt) > SAME_DT * self.problem.dt
            or model.history != self.model.history
        ):
            raise ProblemError(
                f"expected a model with dt {self.problem.dt:g} s and {self.model.history} past commands, "
                f"got {model.dt:g} s and {model.history}"
            )
        self.model = replace(model, integrator="midpoint")
        if (before := self._margins) is not None:
            self._margins = Margins(self.model, self.problem, self._margin_options, adapted=adapted)
            self._margins.drift_detector.carry_over(self._drift, before.drift_detector)
        self._learn_capabilities(adapted)

    def step(
        self,
        x: ArrayLike,
        goal: ArrayLike,
        obstacles: Obstacles = (),
        sent: ArrayLike | None = None,
    ) -> Plan:
        """Plan from the measured pose and give the command of the coming period.

        Parameters
        ----------
        x : array_like
            Pose (3,) [m, m, rad]; any multiple of 2 pi in the heading.
        goal : array_like
            Pose to reach (3,).
        obstacles : sequence of Circle, Polygon, Wall and OccupancyGrid, or array_like
            Where they are now; an array has rows x, y, radius or x, y, radius, vx, vy. Polygons,
            walls and grids are prepared in the first step that sees them, and quickly known again
            as the same or equal objects.
        sent : array_like, optional
            Mean command (2,) of the past period where it was not the last plan's: from a gate with
            acceleration limits, or a pilot. What is learned while driving would else take these for
            the floor. NaN where nobody knows it: nothing is learned from that period.

        Returns
        -------
        Plan
            Whatever the values that came: a finite command within bounds, and a status.

        Raises
        ------
        ValueError
            For wrong shapes, and for nothing else.
        """
        start = self._clock()
        pose, target = np.asarray(x, dtype=float), np.asarray(goal, dtype=float)
        if pose.shape != (STATES,) or target.shape != (STATES,):
            raise ValueError(
                f"x and goal: expected shape ({STATES},) each, got {pose.shape} and {target.shape}"
            )
        circles, self._solids = self._surroundings.sort(obstacles)
        if sent is not None:
            self._past.correct(np.asarray(sent, dtype=float), self.model)
        if self._pose_age:
            pose = advance_pose(self.model, pose, self._past.given, self._pose_age)
        if self.adaptation is not None:
            self._adapt(pose, self.adaptation)
        if not are_plausible(circles):
            return self._without_solution(
                pose, circles[:0], start, {}, 0, f"obstacle not usable: {circles.ravel()[:5]}"
            )
        for name, values in (("pose", pose), ("goal", target)):
            if not is_plausible(values):
                return self._without_solution(
                    pose, circles, start, {}, 0, f"{name} not usable: {values}"
                )
        if self._solids is not None:
            if self._solids.extent > POSITION_LIMIT:
                far, self._solids = self._solids.extent, None
                return self._without_solution(
                    pose, circles, start, {}, 0, f"obstacle not usable: reaches out to {far:g} m"
                )
            self._nearby = self._solids.near(pose[:2], self._reach)
        else:
            self._nearby = None
        turns = 2 * np.pi * round(float(pose[2]) / (2 * np.pi))
        here, target = pose.copy(), target.copy()
        here[2] -= turns
        target[2] -= 2 * np.pi * round(float(target[2]) / (2 * np.pi))
        margins = self._margins
        if margins is not None and self._past.planned is not None:
            # how wrong the model was about the past period widens the margins at once
            before, acted, expected, _ = self._past.planned
            margins.drift_detector.observe(self._drift, here - expected, float(before[2]), acted)
        rest = self._braking.pose_at_rest(here, self._past.command) if self._rates.active else None
        until = np.inf if self._time_budget is None else start + GUIDE_SHARE * self._time_budget
        guidance = (
            None
            if self._guide is None or self._capabilities is None
            else self._guide.reference(
                self._guide_state,
                self._capabilities,
                here,
                target,
                circles,
                self._solids,
                rest,
                until,
            )
        )
        if guidance is not None and guidance.hold:
            return self._hold(here, pose, circles, start)
        reference = (
            self._goal.reference(self._goal_state, here, target)
            if guidance is None
            else guidance.states
        )
        guided = self._clock()
        sqp = self._sqp
        guess, passes = sqp.warm_start.from_last(self._last, here), 1
        if guess is None:
            guess, passes = at_rest(sqp.qp, here), sqp.options.cold_passes
        elif guidance is not None and guidance.switched:
            # a plan along the old path is no good start for the new one
            guess, passes = along(sqp.qp, reference, here), sqp.options.new_path_passes
        deadline = (
            np.inf if self._time_budget is None else start + self._time_budget - self._after_solve
        )
        shifted = self._clock()
        task = Task(
            self.model,
            reference,
            circles,
            self._past.commands,
            self._past.command,
            self._nearby,
            None if margins is None else margins.tightening,
            self._drift,
            np.inf if guidance is None else guidance.path_clearance,
            deadline,
        )
        result = sqp.solve(self._sqp_state, guess, task, passes)
        solved = self._clock()
        usable, self._last, reason = self._verify(result, circles)
        expected = result.next_state
        stop = None
        if usable and self._last is not None:
            stop_task = StopTask(
                self.model,
                self._past.commands,
                self._past.command,
                circles,
                self._nearby,
                result.solids_ahead,
                None if margins is None else margins.command_check,
                self._drift,
            )
            checked = self._stops.find(self._last.states, self._last.inputs, stop_task)
            stop = checked.stop
            if checked.slowed:
                self._last = replace(self._last, states=checked.states, inputs=checked.inputs)
            if stop is None:
                reason = "no way to a stop is clear"
            elif checked.slowed:
                expected = self._last.states[1]
        if usable and self._last is not None and self._limit_change(self._last):
            expected = self._last.states[1]
        verified = self._clock()
        # what is still to come after a solve is learned from the steps before, quickly upwards
        self._after_solve = max(verified - solved + AFTER_SOLVE, 0.95 * self._after_solve)
        timing = {
            "guide": guided - start,
            "shift": shifted - guided,
            **result.timing,
            "verify": verified - solved,
        }
        trajectory = self._last
        if trajectory is None or stop is None:
            return self._without_solution(pose, circles, start, timing, result.passes, reason)
        self._fallback.accept(self._backup, trajectory.states, trajectory.inputs, stop)
        self._past.expect(here, trajectory.inputs[0], expected)
        self._past.remember(trajectory.inputs[0])
        states = trajectory.states
        if turns:
            states = states + (0.0, 0.0, turns)
        status = PlanStatus.FEASIBLE if reason else PlanStatus.SOLVED
        plan = self._plan(
            states, trajectory.inputs, status, circles, start, timing, result.passes, reason
        )
        return plan if guidance is None or guidance.reachable else replace(plan, reachable=False)

    def _adapt(self, pose: Array, adaptation: OnlineAdaptation) -> None:
        """Show the adaptation the past period, and take over the model that it may give."""
        if self._past.driven is not None:
            before, command, past = self._past.driven
            model = adaptation.update(before, command, pose, past)
            if model is not None:
                self.update_model(model, adapted=model is not adaptation.base)
        self._past.seen = pose.copy()

    def _hold(self, here: Array, pose: Array, circles: Array, start: float) -> Plan:
        """Stand at the goal."""
        self._last = at_rest(self._sqp.qp, here)
        self._limit_change(self._last)
        self._fallback.accept(self._backup, self._last.states, self._last.inputs, StopTrajectory())
        self._past.remember(self._last.inputs[0])
        self._past.planned = None
        states = self._last.states + (pose - here)
        plan = self._plan(states, self._last.inputs, PlanStatus.SOLVED, circles, start, {}, 0, "")
        return replace(plan, holding=True)

    def _verify(self, result: SQPResult, circles: Array) -> tuple[bool, Trajectory | None, str]:
        """Whether a result may be driven, the plan with commands within bounds as far as there is one, and what is wrong."""
        if result.status is QPStatus.FAILED:
            return False, None, result.reason
        found = result.trajectory
        if not np.isfinite(result.defect):
            return False, None, "the model's prediction is not finite"
        if result.defect <= DEFECT:
            return True, found, result.reason
        states = self.model.rollout(found.states[0], found.inputs, self._past.commands)
        clearance = self._clearance(states, circles, self._solids)
        reason = f"rolled out anew: the model contradicted the plan by {result.defect:.3g}"
        usable = np.isfinite(states).all() and clearance >= -TOUCH
        return bool(usable), Trajectory(states, found.inputs, found.duals), reason

    def _limit_change(self, plan: Trajectory) -> bool:
        """Bring the command within reach of the one sent last, and roll the plan out anew; tell whether that was needed."""
        if not self._rates.active:
            return False
        wanted = plan.inputs[0]
        command = self._rates.limit(wanted, self._past.command)
        if command is wanted:
            return False
        plan.inputs[0] = command
        plan.states[:] = self.model.rollout(plan.states[0], plan.inputs, self._past.commands)
        return True

    def _without_solution(
        self,
        pose: Array,
        circles: Array,
        start: float,
        timing: dict[str, float],
        passes: int,
        reason: str,
    ) -> Plan:
        """Drive the rest of the last tail while there is one and it is clear, else brake."""
        self._past.planned = None
        rest = self._fallback.replay(self._backup)
        n = self.problem.horizon
        here = pose if is_plausible(pose) else self._backup.expected
        lost = False
        if rest is not None and here is not None:
            # from where the robot is, if that is known: what has happened since the tail was found
            # counts too
            states = self._stops.rollout(self.model, here, rest, self._past.commands)
            lost = not (self._clearance(states, circles, self._solids) >= 0.0)
            if not lost and np.isfinite(states).all():
                if self._rates.active:
                    rest[0] = self._rates.limit(rest[0], self._past.command)
                self._fallback.sent(self._backup, rest[0], states[1])
                self._past.remember(rest[0])
                commands = np.zeros((n, INPUTS))
                commands[: len(rest)] = rest[:n]
                shown = np.concatenate(
                    [states[: n + 1], np.repeat(states[-1:], max(n + 1 - len(states), 0), axis=0)]
                )
                return self._plan(
                    shown, commands, PlanStatus.FALLBACK, circles, start, timing, passes, reason
                )
        self._last = None
        # where the ramp ends in an obstacle, a robot without lag can still stand; one with lag has
        # asked for all that it has
        command = self._fallback.brake(self._backup, at_once=lost)
        if self._rates.active:
            command = self._rates.limit(command, self._past.command)
            self._fallback.sent(self._backup, command, None)
        self._past.remember(command)
        inputs = np.zeros((n, INPUTS))
        inputs[0] = command
        states = np.tile(np.where(np.isfinite(pose), pose, 0.0), (n + 1, 1))
        # where the robot is not known, nor is its distance to anything
        if not np.isfinite(pose).all():
            circles, self._solids = circles[:0], None
        return self._plan(
            states, inputs, PlanStatus.STOPPED, circles, start, timing, passes, reason
        )

    def _plan(
        self,
        states: Array,
        inputs: Array,
        status: PlanStatus,
        circles: Array,
        start: float,
        timing: dict[str, float],
        passes: int,
        reason: str,
    ) -> Plan:
        timing["total"] = self._clock() - start
        # copied, for the caller may move its obstacles in place
        around = PlannedAround(
            circles.copy(), self._solids, self.problem.robot_radius, self.problem.dt
        )
        return Plan(inputs[0].copy(), states, inputs, status, passes, timing, reason, around=around)

    def _clearance(self, states: Array, circles: Array, solids: Solids | None) -> float:
        """Smallest distance between the edges of robot and obstacles along a plan [m]."""
        return PlannedAround(circles, solids, self.problem.robot_radius, self.problem.dt).clearance(
            states
        )
