"""Controller.step: from a measured pose to a command that is safe to send."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.control import settings as settings_of
from kmpc_lite.control.clock import StepClock
from kmpc_lite.control.estimate.history import CommandHistory, LatenessState, whole_age
from kmpc_lite.control.estimate.innovation import UNKNOWN_INFLATION
from kmpc_lite.control.knowledge import Examiner, problem_in_units
from kmpc_lite.control.limits import LONGEST_RAMP, check_motion, following, movable
from kmpc_lite.control.nmpc.qp_solvers import DEFAULT_SOLVER, MakeSolver
from kmpc_lite.control.nmpc.sqp import SQP
from kmpc_lite.control.now import Admission
from kmpc_lite.control.options import ControllerOptions, GuidanceOptions
from kmpc_lite.control.pipeline import Pipeline, make_guide
from kmpc_lite.control.plan import Plan
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.state import ControllerState
from kmpc_lite.control.world.scene import Obstacles
from kmpc_lite.model.file import Ramps
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.planner import Planner


class Controller:
    """Nonlinear model predictive control with a learned bilinear model (paper, alg. 1).

    Parameters
    ----------
    model : KoopmanModel
        Learned by `fit`, or `nominal_unicycle`; its dt must be the problem's. Ramps that its log
        shows limit `du_max` and `deceleration`; one that was not learned takes these for its ramps.
    problem : NavigationProblem, optional
        The paper's if not given.
    guidance : bool or GuidanceOptions
        Whether, and how, to steer along a path around the obstacles, park and hold at the goal.
        Without it the goal itself is the reference, as in the paper. The problem's weights count
        in both modes; where they are not given, each mode has defaults of its own.
    tightening : {"learned", None}
        Whether to keep margins beyond the radii for what the model does not know; None: the paper.
    risk : float, optional
        Probability that the margins are made for; `MarginOptions.risk` if not given.
    adaptation : bool or OnlineAdaptation, optional
        Whether to correct the model while driving; if not given, if there are learned margins, the
        model is continuous, its log shows no delay that it does not know, and no wheels are
        steered: a lag of steering or motor looks like a gain. `adaptation.model` is the corrected
        model; `adaptation.ended` says why a car's adaptation has ended, if it has. An
        `OnlineAdaptation` must be made for `model`.
    pose_age : float
        How old the pose is on arrival [s]; it is brought forward with the commands given meanwhile,
        as it is by how late the robot answers beyond its model, by its log or as it drives.
    sqp_iterations : int, optional
        Passes per step: 1 is the real-time iteration, more run until the plan changes by less than
        `tolerance`. If not given: 1, or more where the robot turns far in a period.
    tolerance : float
        Change of the plan from pass to pass below which no more passes are run.
    time_budget : float, optional
        Longest that a step may take [s]. The QP solver is stopped in time; what it has by then is
        used if it passes the checks (FEASIBLE).
    solver : str or callable
        ``"osqp"``, the fast path, any QP solver that qpsolvers knows and finds installed, or what
        makes a `QPSolver` from a `NavigationQP` and `OSQPOptions`.
    options : ControllerOptions, optional
        Everything else that can be tuned.
    planner : Planner, optional
        Finds the paths of the guidance, in metres and seconds; one of ours if not given.
    clock : callable
        Gives the time for budget and timing [s].
    obstacle_slots : int
        How many obstacles and sides of the area, the nearest ones, each stage is held away from.

    Attributes
    ----------
    state : ControllerState
        All that outlives a step. A copy of it, assigned later, takes the drive back to then.
    known : Knowledge
        What follows from the model in use, in the robot's units.
    units : NavigationProblem
        The problem in the robot's units, with the weights that are used.

    Raises
    ------
    ProblemError
        For arguments that contradict each other.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> controller = Controller(nominal_unicycle(0.1))
    >>> plan = controller.step((0.0, 0.0, 0.0), goal=(1.0, 0.0, 0.0))
    >>> plan.status.name, plan.command.round(2) + 0.0
    ('SOLVED', array([0.6, 0. ]))
    """

    def __init__(  # long: builds the rooms, one after the other
        self,
        model: KoopmanModel,
        problem: NavigationProblem | None = None,
        *,
        guidance: bool | GuidanceOptions = True,
        tightening: Literal["learned"] | None = "learned",
        risk: float | None = None,
        adaptation: bool | OnlineAdaptation | None = None,
        pose_age: float = 0.0,
        sqp_iterations: int | None = None,
        tolerance: float = 1e-5,
        obstacle_slots: int = 5,
        time_budget: float | None = None,
        solver: str | MakeSolver = DEFAULT_SOLVER,
        options: ControllerOptions | None = None,
        planner: Planner | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        problem = settings_of.choose_problem(problem)
        self.options = options = settings_of.choose_options(options, guidance, risk)
        self._settings = settings = settings_of.Settings(
            guidance=bool(guidance),
            tightening=tightening,
            pose_age=pose_age,
            sqp_iterations=1 if sqp_iterations is None else sqp_iterations,
            tolerance=tolerance,
            obstacle_slots=obstacle_slots,
            time_budget=time_budget,
            solver=solver,
            options=options,
            planner=planner,
            clock=clock,
        )
        settings_of.check_settings(model, problem, settings)
        self._asked, self._given = problem, model
        self._seeks_lateness = settings_of.seeks_lateness(model, adaptation, tightening is not None)
        self.adaptation = None
        self._build(None)
        asked = adaptation, tightening is not None, self.problem, options.adaptation
        self.adaptation = settings_of.choose_adaptation(model, *asked)
        self.reset()

    def _build(self, ramps: Array | None) -> None:
        """Build the rooms, one after the other, for a robot of these ramps in its own units."""
        settings, model, self._ramps = self._settings, self._given, ramps
        options, clock = settings.options, settings.clock
        if ramps is not None:
            known = movable(model, self._asked)  # before they were felt
            told = ramps * known.scale.command / known.scale.time
            # slower ones would shrink the fastest speed, and with it all units
            told = np.maximum(told, np.maximum(-known.u_min, known.u_max) / LONGEST_RAMP)
            model = replace(model, info={**model.info, "ramps": Ramps(told, told).as_dict()})
        self.problem = problem = movable(model, self._asked)
        self.scale = scale = problem.scale
        tightens, guides = settings.tightening is not None, settings.guidance
        self._learned = model = following(model, problem)
        self.adaptation = settings_of.adaptation_of(self.adaptation, model)
        self.units = units = problem_in_units(problem, model, guides)
        self._pose_age = age = whole_age(settings.pose_age, model) / scale.time
        self._examiner = Examiner(units, scale, options, tightens, guides)
        self._sqp = SQP(
            units,
            model.history,
            iterations=settings.sqp_iterations,
            tolerance=settings.tolerance,
            slots=settings.obstacle_slots,
            options=options.solver,
            step=options.step,
            solver=settings.solver,
            clock=clock,
        )
        can_be_stopped = self._sqp.workspace.can_be_stopped
        settings_of.check_budget(settings.time_budget, settings.solver, can_be_stopped)
        guide = make_guide(units, options, clock, settings.planner, scale) if guides else None
        self._pipeline = Pipeline(self._asked, units, scale, options, self._sqp, guide, age)
        self._admission = Admission(scale, self._pipeline.scene)

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
        obstacles : sequence of Circle, Polygon, Wall, OccupancyGrid and LaserScan, or array_like
            Where they are now; an array has rows x, y, radius or x, y, radius, vx, vy. Polygons,
            walls and grids are prepared in the first step that sees them. A scan is seen from `x`.
        sent : array_like, optional
            Mean command (2,) of the past period if it was not the last plan's: from a gate with
            acceleration limits, or a pilot. NaN if it is not known.

        Returns
        -------
        Plan
            Whatever the values that came: a finite command within bounds, and a status.

        Raises
        ------
        ValueError
            For wrong shapes and what is no numbers, and for nothing else.
        """
        clock = StepClock(self._settings.clock, self._settings.time_budget)
        tools = self._state, self.known, clock
        now = self._admission.admit(tools, x, goal, obstacles, sent)
        if self._pipeline.bring_forward(now):
            self._answers_otherwise()
        phases, refusal = self._pipeline, self._learn() or now.refusal
        now.known = self.known
        if refusal:
            return phases.refuse(now, refusal)
        phases.estimate(now)
        phases.guide(now)
        if now.guidance is not None and now.guidance.hold:
            return phases.hold(now, now.guidance)
        task = phases.task(now)
        verified = phases.verify(now, phases.solve(now, task), task)
        if verified.trajectory is None or verified.motion is None:
            return phases.fallback.stop(now, verified.reason)
        return phases.command(now, verified)

    @property
    def model(self) -> KoopmanModel:
        """The model in use."""
        return self._state.model

    @property
    def state(self) -> ControllerState:
        """All that outlives a step; a copy of it, assigned later, takes the drive back to then."""
        return self._state

    @state.setter
    def state(self, state: ControllerState) -> None:
        self._state, self._seeks_lateness = state, state.lateness is not None
        if (ramps := state.ramps) is not self._ramps:
            self._build(ramps)
        self.adaptation = settings_of.adaptation_of(self.adaptation, state.base_model)
        if self.adaptation is not None and state.adaptation is not None:
            self.adaptation.restore(state.adaptation, state.model)
        self.known = self._examiner.examine(state.base_model, state.model)

    def reset(self) -> None:
        """Forget the last plan, the commands sent, the path, and what was learned while driving."""
        if self._ramps is not None:
            self._build(None)
        self.adaptation, adaptation = settings_of.adapt_anew(self.adaptation, self._learned)
        history = CommandHistory.start(self.units, self._learned.history, self._pose_age)
        guided = self._settings.guidance
        self._state = ControllerState.start(self._learned, history, guided, adaptation)
        self._state.lateness = LatenessState() if self._seeks_lateness else None
        self.known = self._examiner.examine(self._learned, self._learned)

    def update_model(self, model: KoopmanModel) -> None:
        """Replace the model by another one of the same robot, between two steps.

        Adaptation begins anew, and corrects this one from now on; a discrete model ends it.

        Raises
        ------
        ProblemError
            For another period, or another length of input history.
        """
        given, model = model, following(model, self.problem)
        settings_of.check_replacement(model, self.model, self.problem)
        check_motion(model, self.problem)
        self._given = given
        self._learn_from(model)

    def _learn_from(self, model: KoopmanModel) -> None:
        """Drive with a learned model from now on; what adaptation has learned is forgotten."""
        self._learned = self._state.base_model = model
        self.adaptation, self._state.adaptation = settings_of.adapt_anew(self.adaptation, model)
        self._take_over(model)

    def _answers_otherwise(self) -> None:
        """Take it in that the robot answers later, or more slowly, than was thought."""
        state = self._state
        if (ramps := state.ramps) is not self._ramps:
            self._build(ramps)
            before = state.history
            history = CommandHistory.start(self.units, self._learned.history, self._pose_age)
            history.take_over(before)
            state.history, state.trajectory = history, None
            state.innovation.level = UNKNOWN_INFLATION**2  # hardly known: ramps were felt
        self._learn_from(self._learned)  # adaptation took it for gains

    def _take_over(self, model: KoopmanModel) -> None:
        """Drive with another model from now on."""
        before = self.known.margins
        self._state.model = model
        self.known = self._examiner.examine(self._state.base_model, model)
        if before is not None and self.known.margins is not None:
            errors = self.known.margins.expected_errors
            errors.carry_over(self._state.innovation, before.expected_errors)

    def _learn(self) -> str:
        """Adapt to the past period; return why the model cannot be used, empty if it can."""
        if self.adaptation is None:
            return ""
        scale, before = self.scale, self._state.history.driven
        if before is not None and (now := self._state.history.measured) is not None:
            model = self.adaptation.update(
                before.pose * scale.state,
                before.command * scale.command,
                now * scale.state,
                before.earlier * scale.command,
            )
            if model is not None:
                self._take_over(model)
        return self.adaptation.wrong_model

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle as what it was made of, and its state."""
        drive = self.adaptation, self._state
        return _restored, (self._given, self._asked, self._settings, *drive)


def _restored(
    model: KoopmanModel, problem: NavigationProblem, settings: settings_of.Settings, *drive: Any
) -> Controller:
    """Continue a drive with a new controller; the state of its adaptation is not touched."""
    controller = Controller(model, problem, adaptation=False, **vars(settings))
    controller.adaptation, controller.state = drive
    return controller
