"""What the guide remembers from step to step, what it sees, and what it tells the controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.kernels.records import COLUMNS, SPREAD_RATE, VELOCITY, some_move, some_spread
from kmpc_lite.control.options import MovingObstacleOptions, unit_length
from kmpc_lite.control.path.capabilities import Capabilities, point_of, swing
from kmpc_lite.control.path.moving_obstacles import MovingObstacles, MovingObstacleTable
from kmpc_lite.control.path.planner import PathRequest, Route, TimedPath, distances_around
from kmpc_lite.control.path.progress import GoalCheckerState, ProgressState
from kmpc_lite.control.plan import NO_PROGRESS, GoalProgress
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight import View
    from kmpc_lite.control.world.solids import Solids

BLOCKED = "something that moves stands in the only way"
"""Why there is no path where there is one but for what moves."""


@dataclass(slots=True)
class Search:
    """A search for a path that is under way: what was asked, and how far it has come."""

    request: PathRequest  # what the planner was asked
    same_goal: bool  # whether the path before led to this goal
    stuck: bool  # whether the robot has stood for too long
    lead: float  # how long after the search began the robot is to be where the path begins [s]
    refusal: str = ""  # why the robot cannot stand at its goal; empty if it can, as nearly always
    goal_clearance: float = math.inf  # what the goal leaves beyond the problem's margin [m]
    only_tells: str = ""
    """Why there is no path among what moves, where the search was made without that: only to tell
    whether it is what stands in the way; its path is not driven."""
    parts: int = 0  # how often the planner has worked on it: a copy has it do so again
    quanta: int = 0  # how much work that was


@dataclass(slots=True)
class GuideState:
    """The path, the search for another one, and what they were made for."""

    # the path
    path: TimedPath | None = None  # what is followed
    place: float = 0.0  # where on it the robot is [s]
    leg: float = 0.0  # when its gear has changed last [s]
    path_clearance: float = math.inf  # clearance beyond the problem's margin that it keeps [m]
    goal_clearance: float = math.inf
    """What the goal leaves beyond that margin [m]: less than the path keeps, between obstacles."""
    turning: bool = False  # whether the robot is on its last turn on the spot
    why_none: str = ""  # why there is no path
    waiting: Array | None = None  # pose (3,) at which the robot waits while there is no path
    evasive_arc: int = -1
    """Number of the arc on which it makes room for a moving obstacle; -1: none."""
    turning_centre: Array | None = None
    """Point (2,) that paths are made for, ahead and to the left of the tracked pose [m]; none: that
    pose."""

    looking: bool = False
    """Whether it stands and turns to where its way goes dark, until it has looked there."""
    tried: tuple[Route, ...] = ()
    """Paths on which time was lost, until the robot gets nearer to its goal."""
    stood: Array = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) where the robot began to turn on the spot, and its heading in the last step."""
    turned: float = 0.0  # how far it has turned there [rad]
    steering: bool = False  # whether it stands until its wheels are turned
    yielding: bool = False
    """Whether the robot drives more slowly, or elsewhere, for something that moves."""
    yielded: float = 0.0
    """How long it has stood for something that moves, less what it has driven since [s]."""

    # what the last search was begun for
    goal: Array = field(default_factory=lambda: np.full(3, np.nan))  # (3,), of the tracked pose
    circles: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))  # (M, 5)
    solids: Solids | None = None
    known_solids: Solids | None = None
    """The same, and what scans had shown when the search was begun."""
    coarseness: float = 0.0  # how far these may stand out of what was hit [m]
    age: float = 0.0  # time since then [s]

    unwatched: float = 0.0
    """Time since what scans show was last looked at for what stands on the path [s]."""

    # the search that is under way
    search: Search | None = None
    urgent: bool = False
    """Whether its path is needed in this step: the old one is not for this map or goal."""
    search_time: float = 0.0
    """How long a search takes during which the robot drives on, as the last ones have shown [s]."""
    only_renews: bool = False
    """Whether nothing is wrong with the path: it is kept unless another is much quicker."""
    centre_moved: bool = False
    """Whether the turning centre has moved since the last search was begun."""

    # the checkers
    goal_checker: GoalCheckerState = field(default_factory=GoalCheckerState)
    progress: ProgressState = field(default_factory=ProgressState)

    def kept_on_the_way(self, states: Array, inflation: float) -> float | Array:
        """Clearance beyond the margin that stages 1 to N of states (N + 1, 3) keep [m].

        One number, or one of each stage, (N, 1): where the goal leaves less than the path keeps, no
        more than what is left there. A robot that is to keep more is driven away from a goal
        between obstacles, and swings about it.

        `states`: the reference, or a plan. `inflation`: the problem's [m].
        """
        kept, left = self.path_clearance, max(self.goal_clearance, 0.0)
        if left >= kept:
            return kept
        at_rest = self.circles[~self.circles[:, VELOCITY].any(axis=1)]
        points = states[1:, :2]
        around = distances_around(points, at_rest, self.known_solids, self.coarseness) - inflation
        out: Array = np.minimum(np.maximum(around, left), kept)[:, None]
        return out


NO_TURNS = np.empty(0)
TOLD_STALLS = 2
"""Stalls after which the guidance says that the robot waits: the second follows when something else
was tried and did not help either."""


class GuideTask(NamedTuple):
    """From where to where, among what; poses are those of the tracked point."""

    pose: Array  # (3,) of the robot [m, m, rad]
    goal: Array  # (3,)
    circles: Array  # (M, 7) what is round, now: a table of `kernels.clearance`
    solids: Solids | None = None  # polygons, walls and grids; unequal ones are another map
    rest: Array | None = None
    """Pose (3,) at which the robot would stand if it braked now; where it is, if not given."""
    rolls_on: Array | float = 0.0
    """Displacement (3,) from there, if it lags more than its model knows."""
    until: float = math.inf
    """When to leave a search that is needed at once to the next step [s], on the guide's clock; the
    old path is kept meanwhile, and if there was none the robot stands."""
    view: View | None = None
    """What scans have shown: another path is looked for where that stands on the one driven."""
    speed: float = 0.0  # that was commanded last, below zero backwards [m/s]
    curvature: float = 0.0  # in which the wheels of a car stand now [1/m]
    held: bool = False  # whether its last command was held back: time is not lost meanwhile


class Situation(NamedTuple):
    """Robot, goal and obstacles now; poses are those of the turning centre."""

    pose: Array  # (3,)
    goal: Array  # (3,)
    target: Array  # goal of the tracked pose (3,)
    error: Array  # pose less goal (3,), the heading's in [-pi, pi]
    rest_error: Array  # the same of the pose at which the robot stands if it brakes now
    rolled_error: Array  # the same where it lags more than its model knows: it rolls on
    distance: float  # to the goal [m]
    task: GuideTask  # what else is asked
    moving: MovingObstacles | None  # the circles, if any of them moves
    capabilities: Capabilities
    outside: bool  # whether the goal lies outside the area; then `goal` is the nearest pose inside

    def met(self, waited: float) -> Array:
        """Circles (M, 5) where the robot meets them, which has stood for them so long [s]."""
        moving = self.moving
        met = self.task.circles if moving is None else moving.where_met(self.pose, waited)
        return met[:, :SPREAD_RATE].copy()

    @property
    def told(self) -> Array:
        """Circles (K, 7) with given velocities: what was seen to move is no part of the map."""
        circles = self.task.circles
        if self.moving is None or not some_spread(circles):
            return circles
        told: Array = circles[circles[:, SPREAD_RATE] == 0.0]
        return told


class Surveyor:
    """Sees the situation of a step, from the point about which the robot turns.

    `problem`: area, radius and margin. `options`: what the robot does about what moves.
    """

    def __init__(self, problem: NavigationProblem, options: MovingObstacleOptions) -> None:
        self._inflation = problem.robot_radius + problem.margin
        self._low, self._high = problem.x_min[:2].tolist(), problem.x_max[:2].tolist()
        self._area = np.array([self._low, self._high])
        self._table = MovingObstacleTable(lengths_from_radii(options, unit_length(problem)))

    def see(self, state: GuideState, capabilities: Capabilities, task: GuideTask) -> Situation:
        """See all that the guide is asked; a goal outside the area is moved to its edge."""
        pose, goal, rest = task.pose, task.goal, task.rest
        tolerance = capabilities.tolerances.enter_distance
        (x, y, _), low, high = goal.tolist(), self._low, self._high
        inside_x = low[0] - tolerance <= x <= high[0] + tolerance
        outside = not (inside_x and low[1] - tolerance <= y <= high[1] + tolerance)
        if outside:
            goal = np.array([*np.clip(goal[:2], self._low, self._high), goal[2]])
        target, centre = goal, state.turning_centre
        if centre is not None:
            pose, goal = point_of(pose, centre), point_of(goal, centre)
            rest = None if rest is None else point_of(rest, centre)
        error = pose - goal
        error[2] -= nearest_turn(float(error[2]))
        rest_error = error if rest is None else error + (rest - pose)
        return Situation(
            pose=pose,
            goal=goal,
            target=target,
            error=error,
            rest_error=rest_error,
            rolled_error=rest_error + task.rolls_on,
            distance=math.hypot(error[0], error[1]),
            task=task,
            moving=self._moving(state, capabilities, task),
            capabilities=capabilities,
            outside=outside,
        )

    def _moving(
        self, state: GuideState, capabilities: Capabilities, task: GuideTask
    ) -> MovingObstacles | None:
        """The circles, if any of them moves."""
        circles = task.circles
        if not some_move(circles):
            return None
        inflation = self._inflation + swing(state.turning_centre)
        speed = capabilities.evasive
        # one that moves as given is driven past as ever
        area = self._area if some_spread(circles) else None
        return MovingObstacles(circles, inflation, speed, self._table, task.solids, area)


class Guidance(NamedTuple):
    """Where to steer."""

    states: Array  # (N + 1, 3) reference of the stages; headings next to the robot's
    reachable: bool  # whether there is a path to the goal
    hold: bool
    """Whether the robot is to stand still: it is at the goal, or at the pose in the area that is
    nearest to it."""
    path: Array
    """(K, 2) points of the path from where it was planned to the goal [m]; the place to wait where
    there is none."""
    refreshed: bool  # whether a new path was found in this step, or that there is none
    switched: bool
    """Whether the new path goes another way around, so that a plan along the old one is no good
    start."""
    progress: GoalProgress  # what the robot does about its goal
    reason: str  # why it neither drives there nor holds
    share_at_goal: float  # of the stages: at how many the reference has come to the goal's position
    path_clearance: float | Array
    """What the path keeps beyond the problem's margin [m], or at each stage, (N, 1); less where a
    passage is narrow, or the goal lies between obstacles."""


def wait_in_sight(
    states: Array, state: GuideState, now: Situation, known: float, body: float, turn: float
) -> None:
    """Let the reference (N + 1, 3) wait where it would lead into what is not known.

    A plan that is drawn farther than it may go is solved badly. A robot that waits where
    no scanner looks turns round to look.

    `states`: changed. `state`: updated: whether it looks. `now`: robot, and what scans have shown.
    `known`: how far from the robot everything is told [m]; infinite if it always is. `body`:
    distance that the robot keeps from what is unknown [m]. `turn`: how far it turns from stage to
    stage [rad].
    """
    view = now.task.view
    if view is None and known == math.inf:
        return
    dark = np.zeros(len(states), dtype=bool)
    if known < math.inf:
        dark = np.hypot(*(states[:, :2] - now.pose[:2]).T) > known
    if view is not None:
        dark |= view.is_dark(states[:, :2], 0.0)
        if view.is_narrow:
            dark |= view.leads_into_dark(states[:, :2], now.pose[:2], body)
    first = int(dark.argmax())
    waits = bool(dark[first])
    turns = NO_TURNS
    if waits and view is not None and view.is_narrow:
        turns = view.turns_to_see(states[dark, :2], body, turn)
    # once it has stopped to look, it looks as far as the reference leads: each look is a stop
    state.looking = len(turns) > 0 and (state.looking or first <= 1)
    if state.looking:
        aim = float(turns[np.abs(turns).argmin()])
        states[:] = now.pose
        turned = np.minimum(turn * np.arange(1, len(states) + 1), abs(aim))
        states[:, 2] += math.copysign(1.0, aim) * turned
    elif waits:
        states[first:] = states[max(first - 1, 0)]


def told_progress(
    state: GuideState, hold: bool, scale: float | None, gets_on: bool
) -> tuple[GoalProgress, str]:
    """Tell what a robot on its path does about its goal, and why it does not drive there.

    `scale` is the share of the speed that moving obstacles leave it; none: it makes room for them.
    `gets_on` is whether it has left some of its path behind since it stalled last.
    """
    if hold:
        return GoalProgress.HOLDING, ""
    if scale is None:
        return GoalProgress.DRIVING, ""
    if scale == 0.0:
        return GoalProgress.WAITING, "something that moves is let pass"
    if state.progress.stalls >= TOLD_STALLS and not gets_on:
        return GoalProgress.WAITING, NO_PROGRESS
    return GoalProgress.DRIVING, ""
