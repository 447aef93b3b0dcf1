"""Time lost on the way, and whether the robot has arrived.

Time is lost since the best time to go last fell, of the path and of the goal. Of the path it is the
patience of a robot that stands: then it looks for a path from where it is. Of the goal it tells
that the robot has stalled: whatever paths it was given meanwhile, it has not come nearer than
before. It has arrived where it stands within tolerances, until it is pushed out of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from kmpc_lite.control.clock import newest_weight
from kmpc_lite.control.options import GoalOptions
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

PROGRESS_TIME = 0.05
"""How much time of its path the robot must have left behind for that to count as progress [s]."""
PATIENCE = 0.8  # how long the robot may stand before it looks for a path from where it is [s]
DETOUR_TIME = 0.5
"""A new path that is longer than what was left of the old one by this time is a detour: the
patience begins anew [s]."""
PUSHED = 1.5
"""How many times a wider tolerance a single pose is farther away, at the least, of a robot that was
pushed."""
TURN_SHARE = 0.8
"""Share of `leave_distance` at which the last turn may begin; it is given up at the whole."""
OFF_PATH = 0.01
"""A robot near its goal looks for a new path when it is farther from its path than this [m]."""
QUIET = 0.006, 0.024
"""Standard deviations of measured positions [m] and headings [rad] up to these widen nothing."""
BY_POSITION = {
    "turn_distance": 1.0,
    "turn_limit": 3.5,
    "enter_distance": 1.0,
    "leave_distance": 2.5,
    "pushed_distance": 4.0,
    "off_path": 3.0,
}
"""How many times the deviation beyond the quiet one widens each tolerance: chance hardly
ever carries a single pose farther than 3 to 5 of them, an averaged one than a third of that."""
BY_HEADING = {"enter_angle": 1.0, "leave_angle": 1.5, "pushed_angle": 4.5}  # the same of headings
CONTENT_STALLS, CONTENT_MOST = 4, 5
"""After so many stalls, one after the other, the robot is content with twice its tolerances, then
with once more of them after each further one, up to so many times: what cannot be reached more
closely is held where it is."""
AVERAGING_PERIOD = 0.1
"""Longest period [s] whose poses are averaged by `averaging_time`; a longer one counts as this, so
that five poses count at the least: how much noise is left hangs on how many they are."""


@dataclass(slots=True)
class ProgressState:
    """What is remembered from path to path."""

    least_left: float = math.inf  # least time to the goal on this path so far [s]
    waited: float = 0.0  # time lost on this path [s]; negative while the first turn is made
    best_left: float = math.inf  # least time to this goal that any path has told so far [s]
    worst_left: float = 0.0  # largest one told since [s]
    lost: float = 0.0  # time lost since the best [s], or since something else was tried
    stalls: int = 0  # how often, one after the other, something else had to be tried

    @property
    def is_stuck(self) -> bool:
        """Whether the robot has stood for too long."""
        return self.waited > PATIENCE

    def begin_path(self, left: float, turn: float, other: bool) -> None:
        """Begin a path.

        `left`: time that the path takes [s]. `turn`: time of its first turn, which the controller
        makes while driving [s]: that turn is no progress along the path, but the robot does not
        stand either. `other`: whether it leads another way around than the one before. A path like
        the one before begins a new count only if it is longer by a detour: a robot that swings
        before an obstacle, and looks for its path again and again, makes no progress.
        """
        if other or left > self.least_left + DETOUR_TIME:
            self.least_left, self.waited = left, -turn
        # a path that is quicker from the same place is no progress
        self.best_left = min(self.best_left, left)

    def see(self, left: float, period: float) -> bool:
        """Let a period pass [s] with so much left of the path [s]; whether it has stood too long.

        The robot is not on its last turn.
        """
        if left < self.least_left - PROGRESS_TIME:
            self.least_left, self.waited = left, 0.0
        self.waited += period
        return self.is_stuck

    def watch(self, left: float, period: float, longest: float) -> bool:
        """Let a period pass, and tell whether the robot has stalled: something else is to be tried.

        `left`: time to the goal [s of path]. `period`: time that has passed [s]; zero while the
        robot lets something pass. `longest`: time that may be lost [s].

        Notes
        -----
        A robot that gets on may drive a detour to its end: where its path is longer than the best
        one was, it has twice the difference more time.
        """
        if left < self.best_left - PROGRESS_TIME:
            self.best_left = self.worst_left = left
            self.lost, self.stalls = 0.0, 0
        self.worst_left = max(self.worst_left, left)
        self.lost += period
        detour = 2.0 * (self.worst_left - self.best_left)
        if self.lost <= longest + (0.0 if self.waited > longest else detour):
            return False
        self.lost, self.worst_left = 0.0, self.best_left
        self.stalls += 1
        return True

    def gets_on(self, left: float) -> bool:
        """Whether a robot that has stalled gets on since: on a detour it is not nearer for long."""
        return not self.is_stuck and self.worst_left - left > PATIENCE


@dataclass(frozen=True, slots=True)
class GoalTolerances:
    """How near to the goal is near enough, for one robot, and how its pose is averaged for it."""

    turn_distance: float  # distance at which the last turn may begin [m]
    turn_limit: float  # distance at which a last turn is given up [m]
    enter_distance: float  # distance at which the robot has arrived [m]
    enter_angle: float  # error of the heading at which the robot has arrived [rad]
    leave_distance: float  # distance of the averaged pose at which it drives again [m]
    leave_angle: float  # error of the averaged heading at which it drives again [rad]
    pushed_distance: float  # distance of one single pose at which it drives again [m]
    pushed_angle: float  # error of one single heading at which it drives again [rad]
    off_path: float  # distance from the path at which a new one is looked for near the goal [m]
    averaging: float  # weight of the newest pose in the averaged one


def widened(limits: GoalTolerances, longer: float, wider: float) -> GoalTolerances:
    """Distances so many times as long and angles as wide; who is pushed must come beyond them."""
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

    `model`: its noise at rest is that of the measured poses, its period is between two of them.
    `options`: lengths as the model's. `asked`: distance and angle (2,) within which the robot is to
    stay: a problem's `goal_tolerance`. It takes the place of `leave_distance` and `leave_angle`,
    and what is decided nearer to the goal grows and shrinks with it.
    """
    o = options
    found = GoalTolerances(
        turn_distance=TURN_SHARE * o.leave_distance,
        turn_limit=o.leave_distance,
        enter_distance=o.enter_distance,
        enter_angle=o.enter_angle,
        leave_distance=o.leave_distance,
        leave_angle=o.leave_angle,
        pushed_distance=o.pushed_distance,
        pushed_angle=o.pushed_angle,
        off_path=OFF_PATH,
        averaging=newest_weight(o.averaging_time, model.dt, AVERAGING_PERIOD),
    )
    if asked is not None:
        distance, angle = asked.tolist()
        found = widened(found, distance / o.leave_distance, angle / o.leave_angle)
    # in the error of one period two poses err; what holds for longer is the model's
    x, y, heading = (0.5 * model.noise(np.zeros(model.inputs)).diagonal()).tolist()
    deviations = math.sqrt(0.5 * (x + y)), math.sqrt(heading)
    for deviation, quiet, by in zip(deviations, QUIET, (BY_POSITION, BY_HEADING), strict=True):
        noise = max(deviation - quiet, 0.0)
        found = replace(found, **{name: getattr(found, name) + k * noise for name, k in by.items()})
    return found


@dataclass(slots=True)
class GoalCheckerState:
    """What the goal checker remembers."""

    holding: bool = False  # whether the robot has arrived
    mean_error: Array = field(default_factory=lambda: np.zeros(3))
    """Averaged pose less goal (3,) since then [m, m, rad]."""


def content_with(tolerances: GoalTolerances, stalls: int) -> GoalTolerances:
    """Tolerances of a robot that has not got nearer for so many stalls."""
    if stalls < CONTENT_STALLS:
        return tolerances
    times = min(stalls - CONTENT_STALLS + 2, CONTENT_MOST)
    return widened(tolerances, times, times)


def holds(
    state: GoalCheckerState,
    tolerances: GoalTolerances,
    error: Array,
    stalled: bool = False,
    *rests: Array,
) -> bool:
    """Tell whether the command is to be zero.

    `state`: updated. `tolerances`: of this robot. `error`: pose less goal (3,) [m, m, rad], the
    heading's in [-pi, pi]. `stalled`: whether the robot gets no nearer: it has arrived where it
    would not leave again. `*rests`: the same of poses at which the robot would stand if it braked
    now: by its model, and by how it was seen to move. It holds where all of them are within
    tolerance.
    """
    rest = rests[-1] if rests else error
    if not state.holding:
        state.holding = all(_has_arrived(e, tolerances, stalled) for e in (error, *rests))
        if state.holding:
            state.mean_error = rest.copy()
        return state.holding
    state.mean_error += tolerances.averaging * (rest - state.mean_error)
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
