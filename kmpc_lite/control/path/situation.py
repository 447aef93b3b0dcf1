"""What the guide sees in one step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.kernels.clearance import SPREAD_RATE, some_move, some_spread
from kmpc_lite.control.options import MovingObstacleOptions, lengths_from_radii, unit_length
from kmpc_lite.control.path.capabilities import Capabilities
from kmpc_lite.control.path.moving_obstacles import MovingObstacles, MovingObstacleTable
from kmpc_lite.control.path.turning_centre import point_of, swing
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.state import GuideState
    from kmpc_lite.control.world.sight.view import View
    from kmpc_lite.control.world.solids import Solids


class GuideTask(NamedTuple):
    """From where to where, among what; poses are those of the tracked point."""

    pose: Array
    """(3,) of the robot [m, m, rad]."""
    goal: Array
    """(3,)."""
    circles: Array
    """(M, 7) what is round, now: a table of `kernels.clearance`."""
    solids: Solids | None = None
    """Polygons, walls and grids; unequal ones are another map."""
    rest: Array | None = None
    """Pose (3,) at which the robot would stand if it braked now; where it is, if not given."""
    until: float = math.inf
    """When to leave a search that is needed at once to the next step [s], on the guide's clock; the
    old path is kept meanwhile, and where there was none the robot stands."""
    view: View | None = None
    """What scans have shown: another path is looked for where that stands on the one driven."""
    speed: float = 0.0
    """That was commanded last, in either direction [m/s]."""


class Situation(NamedTuple):
    """Robot, goal and obstacles now; poses are those of the turning centre."""

    pose: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    target: Array
    """Goal of the tracked pose (3,)."""
    error: Array
    """Pose less goal (3,), the heading's in [-pi, pi]."""
    rest_error: Array
    """The same of the pose at which the robot stands if it brakes now."""
    distance: float
    """To the goal [m]."""
    circles: Array
    """(M, 7)."""
    solids: Solids | None
    moving: MovingObstacles | None
    """The circles, if any of them moves."""
    capabilities: Capabilities
    outside: bool
    """Whether the goal lies outside the area; then `goal` is the nearest pose inside."""
    until: float
    """When to leave a search to the next step [s]."""
    view: View | None = None
    """What scans have shown; none without any."""
    speed: float = 0.0
    """That was commanded last, in either direction [m/s]."""

    def met(self, waited: float) -> Array:
        """Circles (M, 5) where the robot meets them, which has stood for them so long [s]."""
        moving = self.moving
        met = self.circles if moving is None else moving.where_met(self.pose, waited)
        return met[:, :SPREAD_RATE].copy()

    @property
    def told(self) -> Array:
        """Circles (K, 7) with given velocities: what was seen to move is no part of the map."""
        if self.moving is None or not some_spread(self.circles):
            return self.circles
        told: Array = self.circles[self.circles[:, SPREAD_RATE] == 0.0]
        return told


class Surveyor:
    """Sees the situation of a step, from the point about which the robot turns.

    Parameters
    ----------
    problem : NavigationProblem
        Area, radius and margin.
    options : MovingObstacleOptions
        What the robot does about what moves.
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
        outside = self._lies_outside(goal, tolerance)
        if outside:
            goal = np.array([*np.clip(goal[:2], self._low, self._high), goal[2]])
        target, centre = goal, state.turning_centre
        if centre is not None:
            pose, goal = point_of(pose, centre), point_of(goal, centre)
            rest = None if rest is None else point_of(rest, centre)
        error = pose - goal
        error[2] -= nearest_turn(float(error[2]))
        return Situation(
            pose=pose,
            goal=goal,
            target=target,
            error=error,
            rest_error=error if rest is None else error + (rest - pose),
            distance=math.hypot(error[0], error[1]),
            circles=task.circles,
            solids=task.solids,
            moving=self._moving(state, capabilities, task),
            capabilities=capabilities,
            outside=outside,
            until=task.until,
            view=task.view,
            speed=task.speed,
        )

    def _lies_outside(self, goal: Array, tolerance: float) -> bool:
        """Whether a goal (3,) lies outside the area by more than a tolerance."""
        (x, y, _), low, high = goal.tolist(), self._low, self._high
        inside_x = low[0] - tolerance <= x <= high[0] + tolerance
        return not (inside_x and low[1] - tolerance <= y <= high[1] + tolerance)

    def _moving(
        self, state: GuideState, capabilities: Capabilities, task: GuideTask
    ) -> MovingObstacles | None:
        """The circles, if any of them moves."""
        circles = task.circles
        if not some_move(circles):
            return None
        inflation = self._inflation + swing(state.turning_centre)
        speed = capabilities.evasive
        # who walks as he is told to is driven past as ever
        area = self._area if some_spread(circles) else None
        return MovingObstacles(circles, inflation, speed, self._table, task.solids, area)
