"""Whether the robot has arrived: it stands within tolerances until it is pushed out of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from kmpc_lite.control.options.goal import GoalOptions
from kmpc_lite.control.running_mean import newest_weight
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import tube_noise
from kmpc_lite.types import Array


@dataclass(frozen=True, slots=True)
class GoalTolerances:
    """How near to the goal is near enough, for one robot, and how its pose is averaged for it."""

    turn_distance: float
    """Distance at which the last turn may begin [m]."""
    turn_limit: float
    """Distance at which a last turn is given up [m]."""
    enter_distance: float
    """Distance at which the robot has arrived [m]."""
    enter_angle: float
    """Error of the heading at which the robot has arrived [rad]."""
    leave_distance: float
    """Distance of the averaged pose at which it drives again [m]."""
    leave_angle: float
    """Error of the averaged heading at which it drives again [rad]."""
    pushed_distance: float
    """Distance of one single pose at which it drives again [m]."""
    pushed_angle: float
    """Error of one single heading at which it drives again [rad]."""
    off_path: float
    """Distance from the path at which a new one is looked for near the goal [m]."""
    averaging: float
    """Weight of the newest pose in the averaged one."""


PUSHED = 1.5
"""How many times a wider tolerance a single pose is farther away, at the least, of a robot that was
pushed."""

Limits = TypeVar("Limits", GoalOptions, GoalTolerances)
"""Both have the same tolerances, by the same names."""


def widened(limits: Limits, longer: float, wider: float) -> Limits:
    """Distances so many times as long and angles as wide, but for the path's.

    Who is pushed is so beyond them.
    """
    distance, angle = longer * limits.leave_distance, wider * limits.leave_angle
    return replace(
        limits,
        turn_distance=longer * limits.turn_distance,
        turn_limit=longer * limits.turn_limit,
        enter_distance=longer * limits.enter_distance,
        enter_angle=wider * limits.enter_angle,
        leave_distance=distance,
        leave_angle=angle,
        pushed_distance=max(limits.pushed_distance, PUSHED * distance),
        pushed_angle=max(limits.pushed_angle, PUSHED * angle),
    )


def goal_tolerances(
    model: MotionModel, options: GoalOptions, asked: Array | None = None
) -> GoalTolerances:
    """Widen the tolerances by the noise of the measured pose that the model has learned.

    Parameters
    ----------
    model : MotionModel
        Its noise at rest is that of the measured poses, its period is between two of them.
    options : GoalOptions
        Lengths as the model's.
    asked : ndarray, optional
        Distance and angle (2,) within which the robot is to stay: a problem's `goal_tolerance`. It
        takes the place of `leave_distance` and `leave_angle`, and what is decided nearer to the
        goal grows and shrinks with it.

    Returns
    -------
    GoalTolerances
        Wider by multiples of the standard deviations beyond the quiet ones.
    """
    position, heading = tube_noise(model.noise_model, model.dt).pose_deviation
    noise = max(position - options.quiet_position, 0.0)
    turn_noise = max(heading - options.quiet_heading, 0.0)
    o = options
    if asked is not None:
        distance, angle = asked.tolist()
        o = widened(o, distance / o.leave_distance, angle / o.leave_angle)
    return GoalTolerances(
        turn_distance=o.turn_distance + o.turn_distance_noise * noise,
        turn_limit=o.turn_limit + o.turn_limit_noise * noise,
        enter_distance=o.enter_distance + o.enter_noise * noise,
        enter_angle=o.enter_angle + o.enter_noise * turn_noise,
        leave_distance=o.leave_distance + o.leave_distance_noise * noise,
        leave_angle=o.leave_angle + o.leave_angle_noise * turn_noise,
        pushed_distance=o.pushed_distance + o.pushed_distance_noise * noise,
        pushed_angle=o.pushed_angle + o.pushed_angle_noise * turn_noise,
        off_path=o.off_path + o.off_path_noise * noise,
        averaging=newest_weight(o.averaging_time, model.dt, o.averaging_period),
    )


@dataclass(slots=True)
class GoalCheckerState:
    """What the goal checker remembers."""

    holding: bool = False
    """Whether the robot has arrived."""
    mean_error: Array = field(default_factory=lambda: np.zeros(3))
    """Averaged pose less goal (3,) since then [m, m, rad]."""


class GoalChecker:
    """Decides whether to stand still.

    Parameters
    ----------
    options : GoalOptions
        In metres.
    """

    def __init__(self, options: GoalOptions) -> None:
        self._options = options

    def content_with(self, tolerances: GoalTolerances, stalls: int) -> GoalTolerances:
        """Tolerances of a robot that has not got nearer for so many stalls."""
        o = self._options
        times = min(max(stalls - o.content_stalls + 2, 1), o.content_most)
        return tolerances if times == 1 else widened(tolerances, times, times)

    def holds(
        self,
        state: GoalCheckerState,
        tolerances: GoalTolerances,
        error: Array,
        rest: Array,
        stalled: bool = False,
    ) -> bool:
        """Tell whether the command is to be zero.

        Parameters
        ----------
        state : GoalCheckerState
            Updated.
        tolerances : GoalTolerances
            Of this robot.
        error : ndarray
            Pose less goal (3,) [m, m, rad], the heading's in [-pi, pi].
        rest : ndarray
            The same of the pose at which the robot would stand if it braked now.
        stalled : bool
            Whether the robot does not get nearer: it has arrived where it would not leave again.
        """
        if not state.holding:
            state.holding = _has_arrived(error, tolerances, stalled) and (
                rest is error or _has_arrived(rest, tolerances, stalled)
            )
            if state.holding:
                state.mean_error = error.copy()
            return state.holding
        state.mean_error += tolerances.averaging * (error - state.mean_error)
        distance, turn = _sizes(error)
        mean_distance, mean_turn = _sizes(state.mean_error)
        pushed = distance > tolerances.pushed_distance or turn > tolerances.pushed_angle
        drifted = mean_distance > tolerances.leave_distance or mean_turn > tolerances.leave_angle
        state.holding = not (pushed or drifted)
        return state.holding


def _has_arrived(error: Array, tolerances: GoalTolerances, stalled: bool) -> bool:
    distance, turn = _sizes(error)
    if stalled:
        return distance <= tolerances.leave_distance and turn <= tolerances.leave_angle
    return distance <= tolerances.enter_distance and turn <= tolerances.enter_angle


def _sizes(error: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] of an error (3,)."""
    x, y, turn = error.tolist()
    return math.hypot(x, y), abs(turn)
