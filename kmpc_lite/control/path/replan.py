"""When another path is looked for: each reason by itself, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kmpc_lite.control.kernels.records import SPREAD_RATE, VELOCITY, leg_end
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.capabilities import follows_poses
from kmpc_lite.control.path.planner import GRID_STEP, NEAR_GOAL, Planner, TimedPath
from kmpc_lite.control.path.search_driver import STANDS, SearchDriver
from kmpc_lite.control.path.situation import GuideState, Situation
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.solids import same_solids
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

OFF_PATH_SHARE = 0.08
"""A robot that is farther from its path than this share of its distance to the goal looks for a new
path; the goal checker's tolerance is the least such distance."""
OFF_PATH_LIMIT = 0.15
"""A robot that is farther from its path than this looks for a new one, however far the goal is
[m]."""
OFF_POSES = 0.05
"""A robot that follows poses keeps to its path up to this distance from it [m]: to come back it may
have to change its gear."""
LOST_DISTANCE = 0.5
"""A robot that is farther from its path than this needs the new one in the same step: somebody has
carried it [m]."""
BLOCKED_INTERVAL = 0.2  # time between two looks whether what was seen lately stands on the path [s]
REFRESH_INTERVAL = 3.0
"""Longest time after which a path is looked for on the map of scans as it is then [s]: what was in
the way may have gone."""
RETRY_INTERVAL = 0.5  # time between two searches if there is no path [s]
MOVED_DISTANCE = 0.01
"""How far an obstacle may be from where it was expected before a new path is looked for [m]."""
SETTLED_SHARE = 0.4
"""A robot that is nearer to its goal than `near_goal`, and is commanded faster than this share of
its speed, is still on its way there: it looks for no new path for having left its own."""
ON_THE_SPOT = 0.075  # a robot that moves by no more than this turns on the spot [m]
TRIED_PATHS = 4  # most paths on which time was lost that are remembered for one goal
LONGEST_LOOK = 2000.0  # time of the longest path that can be looked at in a step [s]


class Replanner:
    """Keeps the guide's path up to date.

    Methods named ``watch`` or ``end`` note what they see in the state, once a step, in the order of
    `update`; those named ``is`` only look.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: GuidanceOptions,
        clock: Callable[[], float],
        planner: Planner,
    ) -> None:
        self._options, self._dt = options, problem.dt
        self._steers = not problem.wheels.turns_on_the_spot
        self._off_poses = OFF_POSES if follows_poses(problem) else 0.0
        self._watch = PathWatch(problem, options)
        moved = MOVED_DISTANCE
        # a velocity that is told otherwise matters once it has led elsewhere: trackers are noisy
        self._moved = np.array([moved, moved, moved, np.inf, np.inf])
        self._searches = SearchDriver(problem, options, clock, planner)

    def update(self, state: GuideState, now: Situation, off: float) -> tuple[bool, bool]:
        """Look for another path where there is a reason.

        `state`: updated. `now`: of this step. `off`: distance of the robot from its path [m].
        Returns `refreshed`, `switched`: whether a search has ended in this step; and whether its
        path, or that there is none, leads another way around than the path before.
        """
        # how far it has turned on the spot where it stands
        if not math.dist(now.pose[:2], state.stood[:2]) <= ON_THE_SPOT:
            state.stood, state.turned = now.pose.copy(), 0.0
        state.turned += wrap(float(now.pose[2] - state.stood[2]))
        state.stood[2] = now.pose[2]
        strayed = self._watch_place(state, now, off)
        grown = self._watch.has_grown_elsewhere(state, now)
        is_new = not grown and self._is_new(state, now)
        # whatever has come up meanwhile, a search that is needed comes to an end: one that begins
        # anew in each step never does
        wanted = off > LOST_DISTANCE or is_new or self._is_blocked(state, now)
        at_once = wanted and not (state.urgent and state.search is not None)
        stalled = self._watch_progress(state, now)
        # the robot drives on what it knows meanwhile, and keeps clear of what has shown up
        cut = state.search is None and not at_once and self._watch.watch_path(state, now)
        if at_once or cut:
            state.progress.least_left = -math.inf  # what comes next begins a new count
        # what was in the way may have gone
        looks = now.task.view is not None and state.path is not None and not state.turning
        is_old = looks and now.distance > NEAR_GOAL and state.age > REFRESH_INTERVAL
        renewed = grown or (state.search is None and is_old)
        begins = at_once or cut or stalled or renewed or (strayed and state.search is None)
        if begins:
            state.only_renews = renewed and not (at_once or cut or stalled or strayed)
            drives_on = not (at_once or stalled or strayed or state.urgent)
            self._searches.begin(state, now, self._watch.lead(state, now) if drives_on else 0.0)
        # what begins anew at each stall ends before the next; a car's has more time where it stands
        state.urgent = state.urgent or at_once or (stalled and not self._steers)
        if begins and now.task.view is not None and not state.urgent:
            return False, False  # what was seen has been made a map of: work enough for a step
        return self._searches.advance(state, now)

    def _watch_place(self, state: GuideState, now: Situation, off: float) -> bool:
        """Note how far it is; whether it is off its path, stands, or has had none for long."""
        if state.path is None:
            return state.age >= RETRY_INTERVAL
        counts = not (state.turning or state.centre_moved or state.steering or now.task.held)
        left = state.path.duration - state.place
        stands = state.progress.see(left, self._dt if counts else 0.0)
        if state.turning:
            return False
        if state.centre_moved:
            return True
        ends = left < self._dt + GRID_STEP and leg_end(state.path.timed, state.leg) == math.inf
        if self._steers and ends and abs(now.task.speed) <= STANDS:
            return True  # what is left to the side it cannot mend where it stands
        o, least = self._options, now.capabilities.tolerances.off_path
        least = max(least, self._off_poses)
        allowed = min(max(least, OFF_PATH_SHARE * now.distance), OFF_PATH_LIMIT)
        too_far = state.age > o.replan_interval and off > allowed
        return stands or (too_far and self._settled(now))

    def _settled(self, now: Situation) -> bool:
        """Whether nothing carries the robot nearer to its goal any more: it is far, or slow."""
        slow = SETTLED_SHARE * float(now.capabilities.forward[0])
        return now.distance > NEAR_GOAL or abs(now.task.speed) <= slow

    def _watch_progress(self, state: GuideState, now: Situation) -> bool:
        """Note the progress: whether there was none for too long; then something else is tried.

        That is the cheapest path: time was lost on the one driven.
        """
        progress, path = state.progress, state.path
        if now.target.tolist() != state.goal.tolist():
            # what was reached of another goal does not count
            progress.best_left, progress.worst_left = math.inf, 0.0
            progress.lost, progress.stalls = 0.0, 0
            state.tried = ()
            return False
        if path is None or state.urgent or state.goal_checker.holding:
            return False
        period = 0.0 if state.yielding or now.task.held else self._dt
        left = path.duration - state.place
        stalled = progress.watch(left, period, self._options.stall_time)
        if not progress.stalls:
            state.tried = ()
        elif stalled and now.distance > NEAR_GOAL:
            tried = path.route(now.pose, state.place, self._options.stall_time)
            state.tried = (*state.tried, tried)[-TRIED_PATHS:]
        return stalled

    def _is_new(self, state: GuideState, now: Situation) -> bool:
        """Whether the goal or the map is another one than the last search was begun for."""
        circles = now.told
        if (
            len(circles) != len(state.circles)
            or not same_solids(now.task.solids, state.solids)
            or now.target.tolist() != state.goal.tolist()
        ):
            return True
        if not len(circles):
            return False
        change = circles[:, :SPREAD_RATE] - state.circles[:, :SPREAD_RATE]
        change[:, :2] -= state.age * state.circles[:, VELOCITY]
        return bool((np.abs(change, out=change) > self._moved).any())

    def _is_blocked(self, state: GuideState, now: Situation) -> bool:
        """Whether a moving obstacle will block the path."""
        if now.moving is None or state.path is None or state.turning:
            return False
        recent = state.age <= self._options.replan_interval
        return not recent and now.moving.blocks(state.path, state.place, state.yielded)


class PathWatch:
    """Looks along the path that is driven.

    `problem`: radius, margin, period. `options`: in metres.
    """

    def __init__(self, problem: NavigationProblem, options: GuidanceOptions) -> None:
        self._options, self._dt = options, problem.dt
        self._inflation = problem.inflation

    def has_grown_elsewhere(self, state: GuideState, now: Situation) -> bool:
        """Whether the map is another one, which leaves the path free: then there is no hurry."""
        path, solids = state.path, now.task.solids
        if solids is state.solids or path is None or solids is None or state.solids is None:
            return False
        if state.urgent or state.turning or same_solids(solids, state.solids):
            return False
        same_circles = now.moving is None and np.array_equal(now.task.circles, state.circles)
        if now.target.tolist() != state.goal.tolist() or not same_circles:
            return False
        if path.drive_end - state.place > LONGEST_LOOK:
            return False  # more than can be looked at in a step
        points = self._points_ahead(state, now, path)
        return not len(points) or bool((solids.whole.least(points) >= self._inflation).all())

    def watch_path(self, state: GuideState, now: Situation) -> bool:
        """Look at times whether something that scans have shown lately stands on the path."""
        view, path = now.task.view, state.path
        if view is None or path is None or state.turning:
            return False
        state.unwatched += self._dt
        if state.unwatched < BLOCKED_INTERVAL or state.age <= self._options.replan_interval:
            return False
        state.unwatched = 0.0
        return view.blocks(self._points_ahead(state, now, path), self._inflation)

    def lead(self, state: GuideState, now: Situation) -> float:
        """How long the robot drives on while a path is looked for [s].

        As long as searches take, or half as long where something stands on the path before that;
        not at all where it stands nearer, if nothing is seen, or if the robot stands: it may stay.
        """
        view, path = now.task.view, state.path
        if view is None or path is None or state.turning or abs(now.task.speed) <= STANDS:
            return 0.0
        for lead in (state.search_time, 0.5 * state.search_time):
            end = min(state.place + lead, path.drive_end)
            points = path.at(np.arange(state.place, end, GRID_STEP))[:, :2]
            if not view.blocks(points, self._inflation):
                return end - state.place
        return 0.0

    def _points_ahead(self, state: GuideState, now: Situation, path: TimedPath) -> Array:
        """Points (n, 2) of the path that is left, but for where the robot is and is to stand.

        There it may come as near to things as it must. Of a path longer than can be looked at in a
        step the beginning is given.
        """
        end = min(path.drive_end, state.place + LONGEST_LOOK)
        points = path.at(np.arange(state.place, end, GRID_STEP))[:, :2]
        ends = [np.hypot(*(points - pose[:2]).T) for pose in (now.pose, now.goal)]
        ahead: Array = points[np.minimum(*ends) > self._inflation]
        return ahead
