"""When another path is looked for, and how much of the search is done in a step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kmpc_lite.control.guidance.path_map import PathMap, coarser, distance_around
from kmpc_lite.control.guidance.path_search import PathSearcher
from kmpc_lite.control.guidance.path_watch import PathWatch, same_solids
from kmpc_lite.control.guidance.progress_checker import ProgressChecker
from kmpc_lite.control.guidance.search_state import PathSearch, Stage
from kmpc_lite.control.guidance.shuttle import ShuttleFinder
from kmpc_lite.control.guidance.situation import Situation
from kmpc_lite.control.guidance.state import GuideState
from kmpc_lite.control.guidance.timed_path import TimedPath
from kmpc_lite.control.guidance.turning_centre import swing
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.types import Array

FORGETTING = 0.95
"""Factor per search by which the remembered time of the longest one shrinks."""


class Replanner:
    """Keeps the guide's path up to date.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, area, period.
    options : GuidanceOptions
        In metres.
    clock : callable
        Gives the time [s] that a situation's `until` is on.
    """

    def __init__(
        self, problem: NavigationProblem, options: GuidanceOptions, clock: Callable[[], float]
    ) -> None:
        self._options, self._clock, self._dt = options, clock, problem.dt
        self._watch = PathWatch(problem, options)
        self._turning = problem.robot_radius + problem.margin
        moved = options.moved_distance
        self._moved = np.array([moved, moved, 0.0, 0.0, 0.0])
        self._limits = problem.x_min[:2], problem.x_max[:2]
        self._progress = ProgressChecker(options)
        self._searcher = PathSearcher(problem, options)
        self._shuttles = ShuttleFinder(problem, options)

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
        strayed = self._has_strayed(state, now, off)
        grown = self._watch.has_grown_elsewhere(state, now)
        is_new = not grown and self._is_new(state, now)
        turned_back = self._turns_back(state, now, is_new)
        # whatever has come up meanwhile, a search that is needed comes to an end: one that begins
        # anew in each step never does
        wanted = off > self._options.lost_distance or is_new or self._is_blocked(state, now)
        at_once = turned_back or (wanted and not (state.urgent and state.search is not None))
        stalled = self._has_stalled(state, now)
        # the robot drives on what it knows meanwhile, and keeps clear of what has shown up
        cut = state.search is None and not at_once and self._watch.is_cut(state, now)
        state.hurried = cut or now.view is not None or (state.hurried and state.search is not None)
        if at_once or cut:
            self._progress.expect_new_path(state.progress)
        renewed = grown or (state.search is None and self._watch.is_to_be_renewed(state, now))
        begins = at_once or cut or stalled or renewed or (strayed and state.search is None)
        if begins:
            state.only_renews = renewed and not (at_once or cut or stalled or strayed)
            drives_on = not (at_once or stalled or strayed or state.urgent)
            self._begin_search(state, now, self._watch.lead(state, now) if drives_on else 0.0)
            near = now.distance < self._options.near_goal and not at_once
            state.attempts = state.attempts + 1 if near else 0
        state.urgent = state.urgent or at_once
        if begins and now.view is not None and not state.urgent:
            return False, False  # what was seen has been made a map of: work enough for a step
        return self._advance_search(state, now)

    def _turns_back(self, state: GuideState, now: Situation, is_new: bool) -> bool:
        """Whether a shuttle has come to its end, so that a path to the goal is needed."""
        if is_new or now.distance > 2.0 * self._options.near_goal:
            state.shuttle, state.shuttles = None, 0
        if state.shuttle is None:
            return False
        distance = math.hypot(*(now.pose - state.shuttle)[:2].tolist())
        if distance > self._options.shuttle_reach:
            return False
        state.shuttle = None
        return True

    def _new_shuttle(self, state: GuideState, now: Situation) -> Array | None:
        """Pose (3,) at which a shuttle that begins here turns back; none where none is begun."""
        o = self._options
        beside = now.capabilities.tolerances.turn_distance < now.distance < o.near_goal
        if state.shuttle is not None or not beside or state.shuttles >= o.shuttles:
            return None
        return self._shuttles.find(now, state.path_map)

    def _has_strayed(self, state: GuideState, now: Situation, off: float) -> bool:
        """Whether the robot's place is a reason: off its path, standing on it, or without one."""
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
        return self._progress.wait(state.progress, self._dt) or too_far

    def _has_stalled(self, state: GuideState, now: Situation) -> bool:
        """Whether the robot has made no progress for too long; then something else is to be tried.

        Far from the goal that is a path on another side of some obstacle, then one that keeps less
        clearance, in turns; near the goal, a path from where the robot is.
        """
        progress, path = state.progress, state.path
        if now.target.tolist() != state.goal.tolist():
            self._progress.expect_new_goal(progress)
            return False
        if path is None or state.urgent or state.goal_checker.holding:
            return False
        period = 0.0 if state.yielding else self._dt
        left = path.duration - state.place
        stalled = self._progress.watch(progress, now.pose, left, period)
        if not progress.stalls:
            state.avoided, state.narrow = None, False
        elif stalled and now.distance > self._options.near_goal:
            state.narrow = progress.stalls % 2 == 0
            state.avoided = None if state.narrow else path
            state.avoided_place = state.place
        return stalled

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
        change = circles - state.circles
        change[:, :2] -= state.age * state.circles[:, 3:]
        return bool((np.abs(change, out=change) > self._moved).any())

    def _is_blocked(self, state: GuideState, now: Situation) -> bool:
        """Whether a moving obstacle will block the path."""
        if now.moving is None or state.path is None or state.turning:
            return False
        recent = state.age <= self._options.replan_interval
        return not recent and now.moving.blocks(state.path, state.place, state.yielded)

    def _begin_search(self, state: GuideState, now: Situation, lead: float = 0.0) -> None:
        """Begin a search from where the robot will be on its path after a time [s].

        One that is under way is given up.
        """
        pose = now.pose.copy()
        if lead > 0.0 and state.path is not None:
            pose = state.path.at(np.array([state.place + lead]))[0]
            pose[2] -= nearest_turn(float(pose[2] - now.pose[2]))
        same_goal = bool((now.target == state.goal).all())
        if now.view is not None:
            known, coarse = now.view.solids(now.solids), now.view.coarseness
            options = coarser(self._options, now.view.lattice_nodes, now.view.lattice_step)
            state.path_map = (
                None if known is None else PathMap(known, options, coarse, True, self._limits)
            )
        elif not same_solids(now.solids, state.solids):
            state.path_map = None
        if state.path_map is None and now.solids is not None:
            state.path_map = PathMap(now.solids, self._options, later=state.only_renews)
        state.goal, state.circles = now.target.copy(), now.told.copy()
        state.solids, state.age, state.centre_moved = now.solids, 0.0, False
        state.circles_at_rest = b"" if now.moving is not None else now.circles.tobytes()
        shuttle = self._new_shuttle(state, now)
        if shuttle is not None:
            state.shuttle, state.shuttles = shuttle, state.shuttles + 1
        state.search = PathSearch(
            pose=pose,
            lead=lead,
            goal=(now.goal if state.shuttle is None else state.shuttle).copy(),
            target=state.goal,
            circles=now.met(state.yielded),
            path_map=state.path_map,
            previous=state.path if same_goal and not state.progress.stuck else None,
            same_goal=same_goal,
            stuck=state.progress.stuck,
            avoid=state.avoided,
            avoid_place=state.avoided_place,
            narrow=state.narrow,
            gear_time=0.0 if now.view is None else now.view.gear_time,
        )

    def _advance_search(self, state: GuideState, now: Situation) -> tuple[bool, bool]:
        """Bring the search forward: nearly always to its end if urgent, else by a few parts."""
        refreshed = switched = False
        o, parts = self._options, 1
        if state.urgent:
            parts = o.urgent_parts
        elif state.hurried:
            parts = o.hurried_parts
        elif state.attempts > 2:
            parts = o.near_goal_parts
        while (search := state.search) is not None:
            none = search.stage is Stage.CHOSEN and search.path is None
            if none and state.shuttle is not None:
                state.shuttle, state.shuttles = None, self._options.shuttles
                self._begin_search(state, now)
            elif none and now.moving is not None and now.moving.stays(state.yielded):
                state.yielded = 0.0
                self._begin_search(state, now)
            elif search.stage is Stage.CHOSEN and state.age < search.lead - 0.5 * self._dt:
                break  # the robot is on its way to where the path begins
            elif search.stage is Stage.CHOSEN:
                refreshed, switched = True, self._take_over(state, now, search)
                state.search, state.urgent = None, False
            else:
                parts -= self._do_part(state, now, search) - 1
            parts -= 1
            if parts <= 0 or (now.until < math.inf and self._clock() > now.until):
                break
        return refreshed, switched

    def _do_part(self, state: GuideState, now: Situation, search: PathSearch) -> int:
        """Do a part of a search; return how many parts it counts as."""
        most = self._options.hurried_parts
        work = search.weight(most)
        search.work += work
        self._searcher.advance(search, state.place, now.capabilities, state.turning_centre)
        if search.stage is Stage.CHOSEN:
            # one more, in which it began
            steps = 1 + math.ceil(search.work / most)
            state.search_time = max(steps * self._dt, FORGETTING * state.search_time)
        return work

    def _take_over(self, state: GuideState, now: Situation, search: PathSearch) -> bool:
        """Follow the path that was chosen, and tell whether it leads another way around."""
        previous, path = state.path, search.path
        if state.only_renews and previous is not None:
            left = previous.duration - state.place - self._options.switch_time
            if path is None or path.time > left - search.gear_time:
                return False
        if path is None:
            state.waiting = search.pose if state.waiting is None else state.waiting
            state.path, state.why_none = None, search.reason
            return previous is not None
        state.waiting = None
        free_turn, o, can = self._free_turn(search), self._options, now.capabilities
        speed = can.backward if path.reverse else can.forward
        if state.shuttles:
            speed = speed * (o.shuttle_speed, 1.0)
        state.path = TimedPath(
            path, search.pose, search.goal, speed, o, free_turn, can.wheels, can.deceleration
        )
        state.path_clearance = max(search.clearance - swing(state.turning_centre), 0.0)
        state.goal_clearance = search.goal_clearance
        other = search.switched or previous is None or not search.same_goal
        begin, _ = state.path.locate(search.pose, 0.0)
        left, turn_time = state.path.duration - begin, free_turn / float(speed[1])
        self._progress.begin_path(state.progress, left, turn_time, other or search.stuck)
        state.place, _ = state.path.locate(now.pose, 0.0)
        return other

    def _free_turn(self, search: PathSearch) -> float:
        """Part of the first turn that is made while driving [rad]; none if the robot is stuck."""
        if search.stuck or search.path is None:
            return 0.0
        o = self._options
        length = float(np.hypot(*np.diff(search.path.points, axis=0).T).sum())
        nearest = distance_around(search.pose[:2], search.circles, search.path_map)
        around = max(nearest - self._turning, 0.0)
        shares = length / o.free_turn_length, around / o.free_turn_clearance
        return o.free_turn * min(1.0, *shares)
