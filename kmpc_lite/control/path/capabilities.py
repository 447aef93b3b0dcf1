"""What a model says its robot can do: how fast it drives and turns, what clearance it needs.

And about which point it turns on the spot: the pose may be tracked at another one, a marker or an
antenna off the axle's middle, or the middle of a skid-steer robot whose weight lies off it. A turn
then moves the pose on a circle. What drives like a unicycle is the turning centre, so paths are
planned for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.options import GoalOptions, GuidanceOptions, unit_length
from kmpc_lite.control.path.progress import GoalTolerances, goal_tolerances
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import rotate
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import answers_late
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.margins import Margins

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
CENTRE_HEADINGS = 8  # at so many headings the model is asked how a turn moves the pose
CENTRE_DISTANCE = 0.004
"""A turning centre nearer to the tracked pose than this is taken to be the tracked pose [m]."""
CENTRE_CERTAINTY = 3.5
"""A turning centre counts only where it lies this many of its standard errors away from the tracked
pose."""
CENTRE_SHARE = 1.0
"""A turning centre counts only where it explains this many times as much of the predicted motion as
it leaves unexplained."""
TINY = 1e-12  # variance of a turn that is none [rad^2]: rounding


@dataclass(frozen=True, eq=False, slots=True)
class Capabilities:
    """What the guide knows of the robot."""

    forward: Array  # (2,) speed [m/s] and rate of turn [rad/s] at which paths are timed forwards
    backward: Array  # (2,) the same backwards; no speed where the robot may not
    turning_centre: Array | None
    """(2,) point about which the robot turns, ahead and to the left of its tracked pose [m]; none:
    the pose itself."""
    tolerances: GoalTolerances  # of the goal checker
    clearance: float  # clearance that a path must keep so that it can be driven at full speed [m]
    wheels: tuple[float, float] = (0.0, np.inf)
    """How far a wheel drives for each radian that the robot turns [m], and its fastest speed
    [m/s]."""
    deceleration: float = np.inf  # with which a path ends [m/s^2]
    late: int = 0  # periods until a command has had half of its effect, where the model knows of it
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


def turning_centre(model: MotionModel, problem: NavigationProblem) -> Array | None:
    """Place of the turning centre as seen from the tracked pose, by the model.

    How the model moves the pose with the turn rate, at several headings, is what a turn about a
    point that is fixed to the robot does: least squares in its two coordinates.

    `model`: with an input history, once a command has been held that long. `problem`: command
    bounds. Returns (2,) ahead and to the left [m]; None if it is the pose itself, or where the
    motion is no turn about a point.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> turning_centre(nominal_unicycle(0.1), NavigationProblem()) is None
    True
    """
    poses, at_rest = np.zeros((CENTRE_HEADINGS, STATES)), np.zeros((CENTRE_HEADINGS, model.inputs))
    poses[:, 2] = math.tau / CENTRE_HEADINGS * np.arange(CENTRE_HEADINGS) - math.pi
    past = at_rest[:, None].repeat(model.history, axis=1)
    lin = model.linearize(poses, at_rest, past)
    moved = (lin.B + lin.B_past.sum(axis=1))[..., -1]
    ahead, left = rotate(moved[:, 0], moved[:, 1], -poses[:, 2])
    turned = moved[:, 2]
    weight = float(turned @ turned)
    # steered wheels turn nothing where they stand
    held = np.zeros((2, model.inputs))
    held[:, -1] = problem.u_min[-1], problem.u_max[-1]
    ends = model.predict(np.zeros((2, STATES)), held, held[:, None].repeat(model.history, axis=1))
    if not 0.0 < weight < np.inf or ends[0, 2] == ends[1, 2]:
        return None
    # turning by a little moves the pose across its arm from the point
    point: Array = np.array([-turned @ left, turned @ ahead]) / weight
    explained = weight * float(point @ point)
    unexplained = float(ahead @ ahead + left @ left) - explained
    least = max(CENTRE_DISTANCE**2, CENTRE_CERTAINTY**2 * _variance(model, problem))
    # the comparisons are also false for NaN
    if not (point @ point >= least and explained >= CENTRE_SHARE * unexplained):
        return None
    return _without_gains(model, point)


def _variance(model: MotionModel, problem: NavigationProblem) -> float:
    """Square of the error [m^2] with which the model's log shows the turning centre.

    Each step of the log, driven at half the bounds, tells of the point by how far it turns.
    """
    u_min, u_max, _, _ = problem.bounds
    usual = 0.5 * np.maximum(u_max, -u_min)
    turned = float(usual[-1]) * model.dt
    samples = float(model.info.get("samples", 1))
    noise = float(np.trace(model.noise(usual)[:2, :2]))
    return 0.5 * noise / max(turned * turned * samples, TINY)


def _without_gains(model: MotionModel, point: Array) -> Array:
    """Take out of a point (2,) the gains that were learned while driving.

    They stretch displacements and turns alike, and cannot know where on the robot it turns.
    """
    adapted = model.info.get("adaptation")
    if not isinstance(adapted, Mapping):
        return point
    ahead, left, turn = (
        float(adapted.get(name, default))
        for name, default in (("ahead", 1.0), ("left", 0.0), ("turn", 1.0))
    )
    stretched: Array = turn * np.linalg.solve([[ahead, -left], [left, ahead]], point)
    return stretched


def seen_from(poses: Array, point: Array) -> Array:
    """Poses (..., 3) of a point (2,) of the robot, ahead and to the left [m].

    Given are the poses of the robot itself; the opposite point leads back.
    """
    seen: Array = poses.copy()
    x, y = rotate(point[0], point[1], poses[..., 2])
    seen[..., 0] += x
    seen[..., 1] += y
    return seen


def point_of(pose: Array, point: Array) -> Array:
    """Give what `seen_from` does for a single pose (3,): plain floats are faster there."""
    x, y, heading = pose.tolist()
    ahead, left = point.tolist()
    dx, dy = rotate(float(ahead), float(left), float(heading))
    return np.array((x + dx, y + dy, heading))


def swing(centre: Array | None) -> float:
    """How far the tracked pose lies from the turning centre (2,) [m]; none: it is the centre."""
    return 0.0 if centre is None else math.hypot(*centre)
