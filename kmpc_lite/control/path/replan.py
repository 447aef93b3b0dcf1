"""When another path is looked for: each reason by itself, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kmpc_lite.control.kernels.clearance import SPREAD_RATE, VELOCITY
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.path_map import same_solids
from kmpc_lite.control.path.path_watch import PathWatch
from kmpc_lite.control.path.planner import Planner
from kmpc_lite.control.path.progress_checker import ProgressChecker
from kmpc_lite.control.path.search_driver import SearchDriver
from kmpc_lite.control.path.situation import Situation
from kmpc_lite.control.path.state import GuideState
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import wrap


class Replanner:
    """Keeps the guide's path up to date.

    Methods named ``watch`` or ``end`` note what they see in the state, once a step, in the order of
    `update`; those named ``is`` only look.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, area, period.
    options : GuidanceOptions
        Lengths as the problem's.
    clock : callable
        Gives the time [s] that a situation's `until` is on.
    planner : Planner
        Finds paths, in the robot's units.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: GuidanceOptions,
        clock: Callable[[], float],
        planner: Planner,
    ) -> None:
        self._options, self._dt = options, problem.dt
        self._watch = PathWatch(problem, options)
        moved = options.moved_distance
        # a velocity that is told otherwise matters once it has led elsewhere: trackers are noisy
        self._moved = np.array([moved, moved, moved, np.inf, np.inf])
        self._progress = ProgressChecker(options)
        self._searches = SearchDriver(problem, options, self._progress, clock, planner)

    def update(self, state: GuideState, now: Situation, off: float) -> tuple[bool, bool]:
        """Look for another path where there is a reason.

        Parameters
        ----------
        state : GuideState
            Updated.
        now : Situation
            Of this step.
        off : float
            Distance of the robot from its path [m].

        Returns
        -------
        refreshed, switched : bool
            Whether a search has ended in this step; and whether its path, or that there is none,
            leads another way around than the path before.
        """
        self._watch_turn(state, now)
        strayed = self._watch_place(state, now, off)
        grown = self._watch.has_grown_elsewhere(state, now)
        is_new = not grown and self._is_new(state, now)
        turned_back = self._end_shuttle(state, now, is_new)
        # whatever has come up meanwhile, a search that is needed comes to an end: one that begins
        # anew in each step never does
        wanted = off > self._options.lost_distance or is_new or self._is_blocked(state, now)
        at_once = turned_back or (wanted and not (state.urgent and state.search is not None))
        stalled = self._watch_progress(state, now)
        # the robot drives on what it knows meanwhile, and keeps clear of what has shown up
        cut = state.search is None and not at_once and self._watch.watch_path(state, now)
        if at_once or cut:
            self._progress.expect_new_path(state.progress)
        renewed = grown or (state.search is None and self._watch.is_to_be_renewed(state, now))
        begins = at_once or cut or stalled or renewed or (strayed and state.search is None)
        if begins:
            state.only_renews = renewed and not (at_once or cut or stalled or strayed)
            drives_on = not (at_once or stalled or strayed or state.urgent)
            self._searches.begin(state, now, self._watch.lead(state, now) if drives_on else 0.0)
        state.urgent = state.urgent or at_once
        if begins and now.view is not None and not state.urgent:
            return False, False  # what was seen has been made a map of: work enough for a step
        return self._searches.advance(state, now)

    def _end_shuttle(self, state: GuideState, now: Situation, is_new: bool) -> bool:
        """End a shuttle that has come to where it turns back; then a path to the goal is needed."""
        if is_new or now.distance > 2.0 * self._options.near_goal:
            state.shuttle, state.shuttles = None, 0
        if state.shuttle is None:
            return False
        distance = math.hypot(*(now.pose - state.shuttle)[:2].tolist())
        if distance > self._options.shuttle_reach:
            return False
        state.shuttle = None
        return True

    def _watch_place(self, state: GuideState, now: Situation, off: float) -> bool:
        """Note how far it is; whether it is off its path, stands, or has had none for long."""
        if state.path is None:
            return state.age >= self._options.retry_interval
        self._progress.see(state.progress, state.path.duration - state.place)
        if state.turning:
            return False
        if state.centre_moved:
            return True
        o, least = self._options, now.capabilities.tolerances.off_path
        allowed = min(max(least, o.off_path_share * now.distance), o.off_path_limit)
        too_far = state.age > o.replan_interval and off > allowed
        return self._progress.wait(state.progress, self._dt) or (too_far and self._settled(now))

    def _settled(self, now: Situation) -> bool:
        """Whether nothing carries the robot nearer to its goal any more: it is far, or slow."""
        o = self._options
        slow = o.settled_share * float(now.capabilities.forward[0])
        return now.distance > o.near_goal or now.speed <= slow

    def _watch_progress(self, state: GuideState, now: Situation) -> bool:
        """Note the progress: whether there was none for too long; then something else is tried.

        That is the cheapest path: time was lost on the one driven.
        """
        progress, path = state.progress, state.path
        if now.target.tolist() != state.goal.tolist():
            self._progress.expect_new_goal(progress)
            state.tried = ()
            return False
        if path is None or state.urgent or state.goal_checker.holding:
            return False
        period = 0.0 if state.yielding else self._dt
        left = path.duration - state.place
        stalled = self._progress.watch(progress, now.pose, left, period)
        if not progress.stalls:
            state.tried = ()
        elif stalled and now.distance > self._options.near_goal:
            tried = path.route(now.pose, state.place, self._options.stall_time)
            state.tried = (*state.tried, tried)[-self._options.tried_paths :]
        return stalled

    def _watch_turn(self, state: GuideState, now: Situation) -> None:
        """Note how far the robot has turned on the spot where it stands."""
        if not math.dist(now.pose[:2], state.stood[:2]) <= self._options.shuttle_reach:
            state.stood, state.turned = now.pose.copy(), 0.0
        state.turned += wrap(float(now.pose[2] - state.stood[2]))
        state.stood[2] = now.pose[2]

    def _is_new(self, state: GuideState, now: Situation) -> bool:
        """Whether the goal or the map is another one than the last search was begun for."""
        circles = now.told
        if (
            len(circles) != len(state.circles)
            or not same_solids(now.solids, state.solids)
            or now.target.tolist() != state.goal.tolist()
        ):
            return True
        if not len(circles) or circles.tobytes() == state.circles_at_rest:
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
