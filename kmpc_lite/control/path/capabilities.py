"""What a model says its robot can do: how fast it drives and turns, what clearance it needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.options import GoalOptions, GuidanceOptions, lengths_from_radii, unit_length
from kmpc_lite.control.path.goal_checker import GoalTolerances, goal_tolerances
from kmpc_lite.control.path.turning_centre import turning_centre
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import answers_late
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.margins.margins import Margins

SPARE_CLEARANCE = 0.02
"""How much more clearance a path keeps than a plan's margin at full speed [m]: a plan that touches
its margin cannot correct itself."""
SPEED_CLEARANCE_LIMIT = 0.1
"""Largest clearance that a path keeps so that it can be driven at full speed [m]: driving slowly
through a passage is better than a long detour."""
LEAST_SPEED_SHARE = 0.05
"""The robot is believed to reach at least this share of each command bound: a model may not know
what its log never showed, and paths must end."""
ONE_SIDED = 0.2
"""A robot that turns to one side by less than this share of its turn rate to the other is planned
for by its own motions."""
ROUNDING = 1e-6
"""Relative difference of speeds that is rounding; and the speed of a robot that cannot drive, or
turn, so that times are finite [m/s, rad/s]."""


@dataclass(frozen=True, eq=False, slots=True)
class Capabilities:
    """What the guide knows of the robot."""

    forward: Array
    """(2,) speed [m/s] and rate of turn [rad/s] at which paths are timed forwards."""
    backward: Array
    """(2,) the same backwards; no speed where the robot may not."""
    turning_centre: Array | None
    """(2,) point about which the robot turns, ahead and to the left of its tracked pose [m]; none:
    the pose itself."""
    tolerances: GoalTolerances
    """Of the goal checker."""
    clearance: float
    """Clearance that a path must keep so that it can be driven at full speed [m]."""
    wheels: tuple[float, float] = (0.0, np.inf)
    """How far a wheel drives for each radian that the robot turns [m], and its fastest speed
    [m/s]."""
    deceleration: float = np.inf
    """With which a path ends [m/s^2]."""
    late: int = 0
    """Periods until a command has had half of its effect, where the model knows of it."""
    curving: float = 1.0
    """Share of its sharpest curvature that a car drives, on arcs at the speeds above."""
    steering_lag: float = 0.0
    """Time until a car's turn rate has changed by half of what was commanded [s]."""

    def adapted(
        self, model: MotionModel, problem: NavigationProblem, turn_share: float
    ) -> Capabilities:
        """Return the same for a model that was adapted: it corrects speeds and curvatures alone."""
        forward, backward = _timing(drivable_speeds(model, problem), turn_share)
        curving = followed_curvature(model, problem, forward, backward)
        return replace(self, forward=forward, backward=backward, curving=curving)

    @property
    def evasive(self) -> Array:
        """Speeds (2,) on evasive arcs, which are driven in either direction: the slower counts."""
        return self.backward if 0.0 < self.backward[0] < self.forward[0] else self.forward


def capabilities(
    model: MotionModel,
    problem: NavigationProblem,
    margins: Margins | None = None,
    options: GuidanceOptions | None = None,
    goal_options: GoalOptions | None = None,
) -> Capabilities:
    """Ask a model for all that the guide needs to know.

    `model`: with an input history it is asked for what it does once a command has been held that
    long. `problem`: command bounds, horizon, radius. `margins`: margins that plans keep. `options`:
    lengths in radii. `goal_options`: lengths in radii.
    """
    options = options or GuidanceOptions()
    goal_options = lengths_from_radii(goal_options or GoalOptions(), unit_length(problem))
    # a robot without lag is steered back before it needs the clearance
    clearance = (
        clearance_at_speed(problem, margins) if margins is not None and model.history else 0.0
    )
    speeds = drivable_speeds(model, problem)
    forward, backward = _timing(speeds, options.turn_share)
    speed_late, turn_late = answers_late(model)
    steering_lag = 0.0
    if not problem.wheels.turns_on_the_spot:
        # a car goes on as its speed does; what its steering does, it can still drive
        steering_lag, turn_late = turn_late * problem.dt, 0
    return Capabilities(
        forward,
        backward,
        turning_centre(model, problem),
        goal_tolerances(model, goal_options, problem.goal_tolerance),
        clearance,
        _wheels(problem, float(speeds[2])),
        options.brake_share * float(problem.du_max[0]),
        # a delay that the model does not know is part of the pose's age
        max(speed_late, turn_late),
        followed_curvature(model, problem, forward, backward),
        steering_lag,
    )


def follows_poses(problem: NavigationProblem) -> bool:
    """Whether paths are driven pose by pose, not as lines between turns on the spot.

    A robot that hardly turns to one side cannot correct what it has turned too far.
    """
    slower, faster = sorted((-float(problem.u_min[-1]), float(problem.u_max[-1])))
    return problem.wheels.follows_poses or slower < ONE_SIDED * faster


def _wheels(problem: NavigationProblem, turn_rate: float) -> tuple[float, float]:
    """How far a wheel drives for a radian of turn [m], and its fastest speed [m/s].

    A robot that makes a third of a turn it is told drives its wheels three times as far for it.
    """
    told = float(np.abs(problem.held_commands[2:, -1]).min())
    half = 0.5 * problem.track * (told / turn_rate if turn_rate > 0.0 else 1.0)
    return half, problem.max_wheel_speed


def _timing(speeds: Array, turn_share: float) -> tuple[Array, Array]:
    """Give speed and rate of turn (2,) forwards, and backwards."""
    ahead, back, turn = speeds.tolist()
    turn = turn_share * max(turn, ROUNDING)
    return np.array([max(ahead, ROUNDING), turn]), np.array([back, turn])


def drivable_speeds(model: MotionModel, problem: NavigationProblem) -> Array:
    """Speeds that the robot holds at the command bounds, by its model, but not above the bounds.

    A skid-steer robot that makes a third of a turn it is told needs three times as long for it; one
    that slips ahead is not asked for more than was commanded.

    `model`: with an input history it is asked for what it does once a command has been held that
    long. `problem`: command bounds. Returns (3,) speed ahead [m/s], backwards [m/s], and rate of
    turn to the slower side [rad/s]; zeros where a bound forbids it.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> drivable_speeds(nominal_unicycle(0.1), NavigationProblem(u_min=(-0.2, -0.8))).round(3)
    array([0.6  , 0.2  , 0.785])
    """
    held = problem.held_commands
    history = np.repeat(held[:, None], model.history, axis=1)
    ends = model.predict(np.zeros((4, 3)), held, history)
    signed = np.array([ends[0, 0], -ends[1, 0], ends[2, 2], -ends[3, 2]]) / model.dt
    bounds = np.array([held[0, 0], -held[1, 0], held[2, -1], -held[3, -1]])
    # rounding must not decide between two paths that are equally quick
    speeds = np.where(
        signed > (1.0 - ROUNDING) * bounds, bounds, np.maximum(signed, LEAST_SPEED_SHARE * bounds)
    )
    return np.array([speeds[0], speeds[1], min(speeds[2], speeds[3])])


def followed_curvature(
    model: MotionModel, problem: NavigationProblem, forward: Array, backward: Array
) -> float:
    """Share of its sharpest curvature that a car drives, in either gear and to either side.

    By its model, on arcs at the speeds (2,) at which paths are timed. All of other wheels.
    """
    sharpest = problem.wheels.curvature
    if not np.isfinite(sharpest):
        return 1.0
    speeds = np.array([forward[0], -backward[0]])
    speeds = np.clip(speeds, -backward[1] / sharpest, forward[1] / sharpest)
    driven = np.repeat(speeds[np.abs(speeds) > ROUNDING], 2)
    rates = sharpest * np.tile((1.0, -1.0), len(driven) // 2) * driven
    held = np.stack([driven, rates], axis=1)
    history = np.repeat(held[:, None], model.history, axis=1)
    ends = model.predict(np.zeros((len(held), 3)), held, history)
    shares = ends[:, 2] / np.hypot(ends[:, 0], ends[:, 1]) * np.sign(rates) / sharpest
    return float(np.clip(shares.min(initial=1.0), LEAST_SPEED_SHARE, 1.0))


def speed_shares(model: MotionModel, problem: NavigationProblem) -> tuple[float, float]:
    """Speed ahead and rate of turn that the robot holds, as shares of the command bounds.

    One where a bound forbids it.
    """
    ahead, _, turn = drivable_speeds(model, problem).tolist()
    u_min, u_max, _, _ = problem.bounds
    fastest, quickest = float(u_max[0]), float(min(u_max[-1], -u_min[-1]))
    return (ahead / fastest if fastest > 0.0 else 1.0, turn / quickest if quickest > 0.0 else 1.0)


def clearance_at_speed(problem: NavigationProblem, margins: Margins) -> float:
    """Clearance [m] that a path must keep so that a plan at full speed along it keeps its margins.

    `problem`: command bounds. `margins`: asked for the last stage's margin.
    """
    # headway gives way to narrow passages, so it asks for no clearance
    _, aside = margins.straight(float(problem.bounds[1][0]))
    return min(SPARE_CLEARANCE + aside, SPEED_CLEARANCE_LIMIT)
