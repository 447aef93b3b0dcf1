"""What follows from problem and model: both in the robot's units (`kmpc_lite.scale`), and margins.

Weights that a problem does not give are chosen here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.kernels.predictor import motion_in_units
from kmpc_lite.control.margins import Margins
from kmpc_lite.control.options import ControllerOptions, fastest
from kmpc_lite.control.problem import GOAL_Q, GOAL_R, NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.capabilities import Capabilities

TRACKING_Q, TRACKING_R = (5.0, 5.0, 0.5), (0.1, 0.02)
"""Weights of a reference that is always near: with the paper's, plans cut corners and creep at the
end."""
CHANGE_WEIGHT, CHANGE_TIME = 0.03, 0.1
"""What a change of a command by its bound within so long [s] costs: half a period at full speed. A
command that jumps to and fro gains nothing that is worth it."""
CORRECTION_TURNS = 2.0
"""How many full turns' time an error is taken to last that the robot comes to its goal with. It
cannot move sideways: it turns aside, drives, turns back, and may have to do that again. Half and
twice as much time arrive about as soon."""


def with_tracking_weights(
    problem: NavigationProblem, gains: tuple[float, float] = (1.0, 1.0)
) -> NavigationProblem:
    """Return the problem with the weights of a guided reference where it gives none.

    What a plan leaves at the goal costs as much as it would for all the time that it takes to make
    it good: `Q_terminal` is Q for so many periods. A quadratic cost of the way alone arrives beside
    the goal (Müller and Worthmann 2017, "Quadratic costs do not always work in MPC").

    `problem`: in the robot's units. `gains`: speed and rate of turn that a robot reaches, as shares
    of what it is told: what is weighed is the motion, and a robot that turns by a third of what it
    is told needs three times the command for it.
    """
    q = np.diag(TRACKING_Q) if problem.Q is None else problem.Q
    r = TRACKING_R[0] * gains[0] ** 2, TRACKING_R[1] * gains[1] ** 2
    turn_rate = gains[1] * fastest(problem)[1]
    periods = CORRECTION_TURNS * math.tau / turn_rate / problem.dt
    # the same acceleration costs the same whatever the period
    bounds = np.maximum(problem.u_max, -problem.u_min)
    change = CHANGE_WEIGHT * (CHANGE_TIME / (problem.dt * bounds)) ** 2
    return _filled(problem, q, r, periods * q, change)


def _filled(
    problem: NavigationProblem,
    q: ArrayLike,
    r: tuple[float, ...],
    terminal: ArrayLike,
    change: ArrayLike | None = None,
) -> NavigationProblem:
    # sideways as ahead
    between = [r[0]] * (len(problem.u_min) - len(r))
    r = (r[0], *between, *r[1:])
    return replace(
        problem,
        Q=q if problem.Q is None else problem.Q,
        R=r if problem.R is None else problem.R,
        R_change=change if problem.R_change is None else problem.R_change,
        Q_terminal=terminal if problem.Q_terminal is None else problem.Q_terminal,
    )


def scaled_problem(problem: NavigationProblem, scale: Scale) -> NavigationProblem:
    """Give the same problem in units: weights too, so that its solution is the same.

    Weights that the user left out stay left out: their defaults are told in units.
    """
    if scale.is_one:
        return problem
    state, command = scale.state, scale.command

    def weight(value: Array | None, factors: Array) -> Array | None:
        return None if value is None else value * factors * factors[:, None]

    slack, near = problem.slack_weights, problem.goal_tolerance
    return replace(
        problem,
        dt=problem.dt / scale.time,
        Q=weight(problem.Q, state),
        R=weight(problem.R, command),
        R_change=weight(problem.R_change, command),
        Q_terminal=weight(problem.Q_terminal, state),
        u_min=problem.u_min / command,
        u_max=problem.u_max / command,
        x_min=problem.x_min / state,
        x_max=problem.x_max / state,
        robot_radius=problem.robot_radius / scale.length,
        footprint=None if problem.footprint is None else problem.footprint.scaled(scale.length),
        margin=problem.margin / scale.length,
        deceleration=problem.deceleration / scale.acceleration,
        du_max=problem.du_max / scale.acceleration,
        slack_weights=slack * (scale.length, scale.length**2),
        track=problem.track / scale.length,
        sensor_range=None if problem.sensor_range is None else problem.sensor_range / scale.length,
        goal_tolerance=None if near is None else near / state[1:],
        max_wheel_speed=problem.max_wheel_speed / scale.speed,
        wheels=problem.wheels.in_units(scale),
    )


@dataclass(frozen=True, eq=False, slots=True)
class Knowledge:
    """All that follows from the model in use."""

    model: MotionModel  # predicts, in the robot's units
    learned: MotionModel  # the same as it was learned, not adapted
    margins: Margins | None  # none without tightening
    capabilities: Capabilities | None  # none without guidance


LITTLE_TURN = 0.25
"""Turn in a period [rad] up to which the midpoint rule is exact enough: it drives ``turn^2 / 24``
too far, here 0.3 %, which is far below what slip does, and takes half the time."""


def motion_model(model: KoopmanModel, units: NavigationProblem, scale: Scale) -> MotionModel:
    """Return a model in the robot's units, as all phases of a step use it."""
    turns_little = units.dt * fastest(units)[1] <= LITTLE_TURN
    driven = replace(model, integrator="midpoint" if turns_little else model.integrator)
    return motion_in_units(driven, scale)


def problem_in_units(
    problem: NavigationProblem, model: KoopmanModel, guides: bool
) -> NavigationProblem:
    """Return a problem in the robot's units, with the weights that its mode uses by default."""
    units = scaled_problem(problem, problem.scale)
    if not guides:
        return _filled(units, GOAL_Q, GOAL_R, np.zeros((STATES, STATES)))  # the paper's
    from kmpc_lite.control.path.capabilities import speed_shares

    # where the robot does not reach its command bounds, the weights say so
    shares = speed_shares(motion_model(model, units, problem.scale), units)
    return with_tracking_weights(units, shares)


class Examiner:
    """Asks models for margins and capabilities; those of the learned model are worked out once."""

    def __init__(
        self,
        units: NavigationProblem,
        scale: Scale,
        options: ControllerOptions,
        tightens: bool,
        guides: bool,
    ) -> None:
        self._units, self._scale, self._options = units, scale, options
        self._tightens, self._guides = tightens, guides
        self._learned: tuple[KoopmanModel, MotionModel, Capabilities | None] | None = None

    def examine(self, base: KoopmanModel, model: KoopmanModel) -> Knowledge:
        """Work out all that follows from the learned model and the one in use."""
        adapted = model is not base
        learned, found = self._as_learned(base)
        motion = motion_model(model, self._units, self._scale) if adapted else learned
        margins = self._margins(motion, adapted)
        if adapted and found is not None:
            found = found.adapted(motion, self._units, self._options.guidance.turn_share)
        return Knowledge(motion, learned, margins, found)

    def _margins(self, motion: MotionModel, adapted: bool) -> Margins | None:
        if not self._tightens:
            return None
        return Margins(motion, self._units, self._options.margins, adapted=adapted)

    def _as_learned(self, base: KoopmanModel) -> tuple[MotionModel, Capabilities | None]:
        if self._learned is None or self._learned[0] is not base:
            motion, found = motion_model(base, self._units, self._scale), None
            if self._guides:
                from kmpc_lite.control.path.capabilities import capabilities

                options, margins = self._options, self._margins(motion, adapted=False)
                found = capabilities(motion, self._units, margins, options.guidance, options.goal)
            self._learned = base, motion, found
        return self._learned[1:]
