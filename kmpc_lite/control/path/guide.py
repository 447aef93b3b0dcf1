"""A reference around obstacles, so that the controller is never trapped behind one.

A step of the guide: locate the robot on its path; look for another one where the map, the goal, or
the robot's place gives a reason (`replan`); read the reference of the coming stages off the path.
All for the point about which the robot turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import leg_end
from kmpc_lite.control.options import GuidanceOptions, MovingObstacleOptions, unit_length
from kmpc_lite.control.path.capabilities import Capabilities, follows_poses, seen_from
from kmpc_lite.control.path.field_planner import FieldPlanner
from kmpc_lite.control.path.grid_planner import GridPlanner
from kmpc_lite.control.path.moving_obstacles import MovingObstacles
from kmpc_lite.control.path.planner import CUSP_REACH, GRID_STEP, Planner, TimedPath
from kmpc_lite.control.path.progress import content_with, holds
from kmpc_lite.control.path.replan import Replanner
from kmpc_lite.control.path.search_driver import STANDS
from kmpc_lite.control.path.situation import (
    BLOCKED,
    Guidance,
    GuideState,
    GuideTask,
    Situation,
    Surveyor,
    told_progress,
    wait_in_sight,
)
from kmpc_lite.control.plan import NO_PROGRESS, UNSEEN, GoalProgress
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import rotate, seen_along
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

NEAR_CUSP = 0.075  # distance from a change of gear at which the robot goes on in the other one [m]
CENTRE_CHANGE = 0.001  # changes of the turning centre below this are ignored [m]
ORIGIN = np.zeros(2)


class Guide:
    """Finds paths, and keeps to one.

    `problem`: bounds, radius and margin, horizon and period. `options`: how paths are found, timed
    and followed; lengths in radii. `moving`: what it does about moving obstacles. `clock`: gives
    the time [s] that `until` is on. `planner`: finds paths, in the robot's units; one that fits the
    wheels if not given.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: GuidanceOptions | None = None,
        moving: MovingObstacleOptions | None = None,
        clock: Callable[[], float] = perf_counter,
        planner: Planner | None = None,
    ) -> None:
        unit = unit_length(problem)
        self._options = lengths_from_radii(options or GuidanceOptions(), unit)
        self._dt = problem.dt
        self._times = problem.dt * np.arange(problem.horizon + 1)
        self._surveyor = Surveyor(problem, moving or MovingObstacleOptions())
        self._range = math.inf if problem.sensor_range is None else problem.sensor_range
        self._body = problem.inflation
        arms = 0.0 if problem.footprint is None else problem.footprint.reach
        self._swept = problem.body_radius + arms
        self._by_poses = follows_poses(problem)
        # a reference that runs ahead on arcs is nearer inside of them
        self._wheels = problem.wheels
        lead = self._options.lead_time if problem.wheels.turns_on_the_spot else 0.0
        self._ahead = lead + self._times
        if planner is None and self._by_poses:
            planner = FieldPlanner(problem, problem.wheels)
        elif planner is None:
            planner = GridPlanner(problem, options or GuidanceOptions())
        self._replanner = Replanner(problem, self._options, clock, planner)

    def reference(self, state: GuideState, capabilities: Capabilities, task: GuideTask) -> Guidance:
        """Give the reference of the coming stages.

        `state`: what the steps before have left; updated. `capabilities`: of the robot, as they are
        known now. `task`: what is asked.
        """
        self._take_over_centre(state, capabilities.turning_centre)
        state.age += self._dt
        now = self._surveyor.see(state, capabilities, task)
        self._begin_last_turn(state, now)
        off, turned = 0.0, False
        if state.path is not None:
            least = state.path.drive_end if state.turning else state.leg
            state.place, off = library.locate(state.path.timed, now.pose, state.place, least)
            turned = self._change_gear(state, now, state.path)
        refreshed, switched = self._replanner.update(state, now, off)
        switched = switched or turned
        if state.path is None:
            guidance = self._wait(state, now, refreshed, switched)
        else:
            guidance = self._follow(state, now, state.path, refreshed, switched)
        if state.turning_centre is None:
            return guidance
        return guidance._replace(states=seen_from(guidance.states, -state.turning_centre))

    def _take_over_centre(self, state: GuideState, centre: Array | None) -> None:
        """Plan for another turning centre; the path is kept until there is one for it."""
        if centre is state.turning_centre:
            return
        before, now = (ORIGIN if c is None else c for c in (state.turning_centre, centre))
        if math.hypot(*(now - before)) >= CENTRE_CHANGE:
            state.turning_centre, state.centre_moved = centre, True

    def _change_gear(self, state: GuideState, now: Situation, path: TimedPath) -> bool:
        """Go on to the next leg of a path where the robot has come to a change of its gear.

        Whether the last plan is of no more use: it stands there, and linearised at it, what is
        beside a car would keep it from turning on.
        """
        comes = False
        end = leg_end(path.timed, state.leg)
        if end < math.inf:
            (begin, cusp), here = path.at(np.array([state.leg, end])), now.pose
            if self._by_poses:
                # of a leg shorter than that it must have driven half, for it begins at rest
                near = state.place > max(end - self._dt - GRID_STEP, 0.5 * (state.leg + end))
                left = path.gear_at(state.leg) * float(seen_along(cusp - here, here[2])[0])
                comes = near and (left <= CUSP_REACH or abs(now.task.speed) <= STANDS)
            else:
                reach = min(NEAR_CUSP, math.dist(begin[:2], here[:2]))
                comes = math.dist(cusp[:2], here[:2]) <= reach
            if comes:
                state.leg = state.place = end
        return comes and self._by_poses

    def _begin_last_turn(self, state: GuideState, now: Situation) -> None:
        """Begin the last turn where the robot comes to a stop; give it up where it has left."""
        # a robot that does not get nearer is content with less
        tolerances = content_with(now.capabilities.tolerances, state.progress.stalls)
        if self._by_poses:
            state.turning = False
        elif state.turning:
            state.turning = now.distance <= tolerances.turn_limit
        else:
            at_rest = math.hypot(now.rest_error[0], now.rest_error[1])
            # a robot that has stalled does not get nearer
            stalled = state.progress.stalls > 0
            limit = tolerances.turn_limit if stalled else tolerances.turn_distance
            state.turning = max(now.distance, at_rest) <= limit

    def _wait(self, state: GuideState, now: Situation, refreshed: bool, switched: bool) -> Guidance:
        """Give the reference of a robot without a path: it waits, and makes room for what moves."""
        place = now.pose if state.waiting is None else state.waiting
        states = np.tile(np.array([place[0], place[1], now.pose[2]]), (len(self._times), 1))
        if now.moving is not None and not now.moving.spares(now.pose):
            states = self._evade(state, now, now.moving)
        # what was seen from afar, or long ago, does not tell that there is no path, nor does what
        # goes on its way
        may_be = state.urgent or now.task.view is not None or state.why_none == BLOCKED
        return Guidance(
            states=states,
            reachable=may_be,
            hold=False,
            progress=GoalProgress.WAITING if may_be else GoalProgress.UNREACHABLE,
            reason="a path is being looked for" if state.urgent else state.why_none,
            path=place[None, :2],
            refreshed=refreshed,
            switched=switched,
            share_at_goal=0.0,
            path_clearance=state.path_clearance,
        )

    def _follow(
        self, state: GuideState, now: Situation, path: TimedPath, refreshed: bool, switched: bool
    ) -> Guidance:
        """Give the reference along the path: slower, or beside it, where something moves."""
        limit = max if state.turning else min
        state.place = place = limit(state.place, path.drive_end)
        usual = now.capabilities.tolerances
        moving, tolerances = now.moving, content_with(usual, state.progress.stalls)
        # a car that has come to rest at the end of its path gets no nearer but by changes of gear
        left, cannot_turn = path.duration - place, not self._wheels.turns_on_the_spot
        ends = left <= self._dt + GRID_STEP and leg_end(path.timed, state.leg) == math.inf
        rests = cannot_turn and left <= self._dt and abs(now.task.speed) <= STANDS
        stalled = rests or state.progress.stalls > 0
        hold = holds(
            state.goal_checker, tolerances, now.error, stalled, now.rest_error, now.rolled_error
        )
        hold = hold and (moving is None or moving.spares(now.pose))
        scale = 1.0 if moving is None else moving.speed_scale(path, place)
        if moving is not None and scale is None:
            begins = state.evasive_arc
            states = self._evade(state, now, moving)
            # the last plan leads to where the robot must not stay
            switched = switched or state.evasive_arc != begins
        else:
            state.evasive_arc = -1
            states = self._along(path, state, scale or 0.0, now)
            rest, heading = now.rolled_error, float(now.pose[2])
            ahead, _ = rotate(float(rest[0]), float(rest[1]), -heading)
            beyond = path.gear_at(state.leg) * ahead
            if cannot_turn and ends and -CUSP_REACH <= beyond <= usual.enter_distance:
                along = ahead * math.cos(heading), ahead * math.sin(heading), 0.0
                states[:] = now.pose + (rest - now.error) - along  # it would shuffle to mend more
            turn = float(now.capabilities.forward[1]) * self._dt
            wait_in_sight(states, state, now, self._range, self._body, turn)
        state.yielding = scale != 1.0
        state.yielded = max(state.yielded + (self._dt if scale == 0.0 else -self._dt), 0.0)
        progress, reason = told_progress(state, hold, scale, state.progress.gets_on(left))
        if reason == NO_PROGRESS and now.task.view is not None:
            unseen = now.task.view.is_dark(now.pose[None, :2], self._swept)[0]
            reason = UNSEEN if unseen else reason
        if hold and tolerances is not usual:
            reason = "it holds where it is: it does not get nearer to its goal"
        if now.outside:
            progress, reason = GoalProgress.UNREACHABLE, "the goal lies outside the area"
        return Guidance(
            states=states,
            reachable=not now.outside,
            hold=hold,
            progress=progress,
            reason=reason,
            path=path.points,
            refreshed=refreshed,
            switched=switched,
            share_at_goal=path.share_at_goal(states),
            path_clearance=state.path_clearance,
        )

    def _along(self, path: TimedPath, state: GuideState, scale: float, now: Situation) -> Array:
        """States (N + 1, 3) along the path at a share of its speed, headings near the robot's.

        A car that stands turns its wheels first.
        """
        place, leg, heading = state.place, state.leg, float(now.pose[2])
        along = partial(library.along_path, path.timed)
        later = self._ahead * scale
        states = along(later, place, leg, heading, state.turning)
        steering = 0.0
        if now.task.speed * path.gear_at(max(place, leg)) <= STANDS:
            steering = self._wheels.steering_time(now.task.curvature, states, self._dt)
        state.steering = steering > self._dt
        if state.steering:
            # wheels that take longer than is foreseen must be told what they are turned for
            waits = min(steering, float(later[len(later) // 2]))
            states = along(np.maximum(later - waits, 0.0), place, leg, heading, state.turning)
        return states

    def _evade(self, state: GuideState, now: Situation, moving: MovingObstacles) -> Array:
        """States (N + 1, 3) on an arc that makes room."""
        state.evasive_arc, states = moving.evasive_arc(now.pose, state.evasive_arc, self._times)
        return states
