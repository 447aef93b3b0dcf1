"""What a user may ask of a controller, checked before anything is built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.steps import AdaptationState
from kmpc_lite.control.estimate.history import oldest_pose
from kmpc_lite.control.kernels.predictor import motion_in_units
from kmpc_lite.control.nmpc.qp_solvers import MakeSolver
from kmpc_lite.control.options import ControllerOptions, GuidanceOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.files import SAME_DT
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import unmodelled_delay
from kmpc_lite.scale import Scale

if TYPE_CHECKING:
    from kmpc_lite.control.path.planner import Planner

SHORTEST_PERIOD, LONGEST_PERIOD = 1e-4, 100.0
"""Periods of a problem [s]: a ramp of a second would else have more stages than there is memory
for, and what is longer is no control period but a slip of the pen."""


@dataclass(frozen=True)
class Settings:
    """Arguments of a `Controller` by their names, as it uses them; it is copied by these."""

    guidance: bool
    tightening: Literal["learned"] | None
    pose_age: float  # [s]
    sqp_iterations: int
    tolerance: float
    obstacle_slots: int
    time_budget: float | None  # [s]
    solver: str | MakeSolver
    options: ControllerOptions
    planner: Planner | None
    clock: Callable[[], float]


def choose_problem(problem: NavigationProblem | None) -> NavigationProblem:
    """Give the problem, the paper's if there is none; raise ProblemError for anything else."""
    if problem is None:
        return NavigationProblem()
    if isinstance(problem, NavigationProblem):
        return problem
    hint = "; NavigationProblem(**{...}) makes one" if isinstance(problem, dict) else ""
    name = type(problem).__name__
    raise ProblemError(f"problem: expected a NavigationProblem, got {name}{hint}")


def choose_options(
    options: ControllerOptions | None, guidance: bool | GuidanceOptions, risk: float | None
) -> ControllerOptions:
    """Options with what was said in arguments of their own."""
    if not isinstance(guidance, bool | GuidanceOptions):
        raise ProblemError(f"guidance: expected True, False or GuidanceOptions, got {guidance!r}")
    chosen = ControllerOptions() if options is None else options
    if not isinstance(chosen, ControllerOptions):
        raise ProblemError(f"options: expected ControllerOptions, got {type(chosen).__name__}")
    if isinstance(guidance, GuidanceOptions):
        chosen = replace(chosen, guidance=guidance)
    if risk is not None:
        if isinstance(risk, bool) or not isinstance(risk, int | float) or not 0.0 < risk < 1.0:
            raise ProblemError(f"risk: expected a probability between 0 and 1, got {risk!r}")
        margins = replace(chosen.margins, risk=float(risk))
        chosen = replace(chosen, margins=margins)
    return chosen


def check_settings(model: Any, problem: NavigationProblem, settings: Settings) -> None:
    """Raise ProblemError for arguments of a controller that cannot be meant."""
    if not isinstance(model, KoopmanModel):
        raise ProblemError(
            f"model: expected a KoopmanModel, got {type(model).__name__}; "
            "KoopmanModel.load(path) reads a file"
        )
    if model.inputs != len(problem.u_min):
        raise ProblemError(
            f"model: its commands have {model.inputs} numbers, those of the problem's wheels "
            f"{len(problem.u_min)}"
        )
    check_period(model, problem)
    for name in ("sqp_iterations", "obstacle_slots"):
        value = getattr(settings, name)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise ProblemError(f"{name}: expected a whole number >= 1, got {value!r}")
    tolerance, budget, age = settings.tolerance, settings.time_budget, settings.pose_age
    tightening = settings.tightening
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ProblemError(f"tolerance: expected a number > 0, got {tolerance!r}")
    if budget is not None and not (np.isfinite(budget) and budget > 0):
        raise ProblemError(f"time_budget: expected a time > 0 s, got {budget!r}")
    if not SHORTEST_PERIOD <= problem.dt <= LONGEST_PERIOD:
        raise ProblemError(
            f"dt: expected a period from {SHORTEST_PERIOD:g} to {LONGEST_PERIOD:g} s, "
            f"got {problem.dt:g} s"
        )
    oldest = oldest_pose(problem.dt)
    if not 0.0 <= age <= oldest:
        raise ProblemError(f"pose_age: expected a time from 0 to {oldest:g} s, got {age!r}")
    if tightening not in (None, "learned"):
        raise ProblemError(f"tightening: expected 'learned' or None, got {tightening!r}")
    if problem.sensor_range is not None and tightening is None:
        raise ProblemError(
            "sensor_range: plans are checked for a stop within it only with tightening='learned'"
        )


def check_period(model: KoopmanModel, problem: NavigationProblem) -> None:
    """Raise ProblemError for a model of another period than the problem's."""
    if abs(model.dt - problem.dt) > SAME_DT * problem.dt:
        raise ProblemError(
            f"the model's dt is {model.dt:g} s, the problem's {problem.dt:g} s; fit the log at the "
            f"problem's dt, or use NavigationProblem(dt={model.dt:g}) or "
            f"model.with_dt({problem.dt:g})"
        )


def check_replacement(new: KoopmanModel, old: KoopmanModel, problem: NavigationProblem) -> None:
    """Raise ProblemError for a model that cannot take another's place while driving."""
    if abs(new.dt - problem.dt) > SAME_DT * problem.dt or new.history != old.history:
        raise ProblemError(
            f"expected a model with dt {problem.dt:g} s and {old.history} past commands, "
            f"got {new.dt:g} s and {new.history}"
        )


def choose_adaptation(
    model: KoopmanModel,
    adaptation: bool | OnlineAdaptation | None,
    tightens: bool,
    problem: NavigationProblem,
    options: AdaptationOptions,
) -> OnlineAdaptation | None:
    """What learns while driving; by default if there are margins and the model is continuous.

    Nor does it by default if the robot answers later than the model knows, or is steered by wheels:
    it would take the delay for gains.

    Raises ProblemError for one that was made for another model, or for a robot of another size or
    speed.
    """
    scale, steered = problem.scale, not problem.wheels.turns_on_the_spot
    if adaptation is None:
        adaptation = seeks_lateness(model, None, tightens) and not steered
    if adaptation is True:
        return _adaptation(model, options, scale, steered)
    if not adaptation:
        return None
    if adaptation.base is not model:
        raise ProblemError("adaptation: it was made for another model than the controller's")
    if adaptation.scale != scale:
        raise ProblemError(
            f"adaptation: it was made for another robot: expected its units {scale}, "
            f"got {adaptation.scale}; OnlineAdaptation(model, scale=problem.scale) takes them over"
        )
    return adaptation


def seeks_lateness(
    model: KoopmanModel, adaptation: bool | OnlineAdaptation | None, tightens: bool
) -> bool:
    """Whether it is found while driving how late the robot answers."""
    if adaptation is None:
        return tightens and model.continuous and not unmodelled_delay(model)
    return adaptation is not False


def adaptation_of(
    adaptation: OnlineAdaptation | None, model: KoopmanModel
) -> OnlineAdaptation | None:
    """Return what learns while driving with this learned model: as before, or a new one like it."""
    if adaptation is None or adaptation.base is model:
        return adaptation
    if not model.continuous:
        return None
    return _adaptation(model, adaptation.options, adaptation.scale, adaptation.steered)


def _adaptation(
    model: KoopmanModel, options: AdaptationOptions, scale: Scale, steered: bool
) -> OnlineAdaptation:
    predictor = motion_in_units(model, Scale(inputs=model.inputs))
    return OnlineAdaptation(model, options, scale, steered, predictor)


def adapt_anew(
    adaptation: OnlineAdaptation | None, model: KoopmanModel
) -> tuple[OnlineAdaptation | None, AdaptationState | None]:
    """Return what learns from now on, with nothing learned yet, and its state."""
    adaptation = adaptation_of(adaptation, model)
    if adaptation is None:
        return None, None
    adaptation.reset()
    return adaptation, adaptation.state


def check_budget(time_budget: float | None, solver: object, can_be_stopped: bool) -> None:
    """Raise ProblemError for a time budget that the QP solver does not let keep."""
    if time_budget is not None and not can_be_stopped:
        raise ProblemError(
            f"time_budget: {solver} cannot be stopped in time; use solver='osqp', or no budget"
        )
