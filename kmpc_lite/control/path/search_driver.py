"""The search for a path, brought forward by a few parts in each step, and its path taken over."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.path_map import PathMap, coarser, distance_around, distances_around
from kmpc_lite.control.path.path_search import PathSearcher
from kmpc_lite.control.path.path_watch import same_solids
from kmpc_lite.control.path.progress_checker import ProgressChecker
from kmpc_lite.control.path.search_state import PathSearch, Stage
from kmpc_lite.control.path.shuttle import ShuttleFinder
from kmpc_lite.control.path.situation import Situation
from kmpc_lite.control.path.state import BLOCKED, GuideState
from kmpc_lite.control.path.tangent_graph import GeometricPath
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.control.path.turning_centre import swing
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.recent_times import longest_lately
from kmpc_lite.geometry import nearest_turn, rotate
from kmpc_lite.types import Array


class SearchDriver:
    """Begins searches, brings them forward, and takes over what they find.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, area, period.
    options : GuidanceOptions
        How paths are found; lengths as the problem's.
    progress : ProgressChecker
        Is told of new paths.
    clock : callable
        Gives the time [s] that a situation's `until` is on.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: GuidanceOptions,
        progress: ProgressChecker,
        clock: Callable[[], float],
    ) -> None:
        self._options, self._progress, self._clock = options, progress, clock
        self._dt = problem.dt
        self._turning = problem.robot_radius + problem.margin
        self._limits = problem.x_min[:2], problem.x_max[:2]
        self._inflation, self._is_round = problem.inflation, problem.footprint is None
        self._searcher = PathSearcher(problem, options)
        self._shuttles = ShuttleFinder(problem, options)

    def begin(self, state: GuideState, now: Situation, lead: float = 0.0) -> None:
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
        state.search = self._search(state, now, pose, lead, same_goal, now.met(state.yielded))

    def _search(
        self,
        state: GuideState,
        now: Situation,
        pose: Array,
        lead: float,
        same_goal: bool,
        circles: Array,
    ) -> PathSearch:
        """A search among circles (M, 5), and what the state says of it."""
        return PathSearch(
            pose=pose,
            lead=lead,
            goal=(self._aim(now, pose) if state.shuttle is None else state.shuttle).copy(),
            target=state.goal,
            circles=circles,
            path_map=state.path_map,
            previous=state.path if same_goal and not state.progress.stuck else None,
            same_goal=same_goal,
            stuck=state.progress.stuck,
            avoid=state.avoided,
            avoid_place=state.avoided_place,
            narrow=state.narrow,
            gear_time=0.0 if now.view is None else now.view.gear_time,
        )

    def _aim(self, now: Situation, pose: Array) -> Array:
        """Pose (3,) at which a path from a pose ends: near the goal, a little beside it.

        What lies beside the robot it can only reach by turning away and back.
        """
        o, goal = self._options, now.goal
        if now.distance > o.near_goal:
            return goal
        most = o.goal_slack * now.capabilities.tolerances.turn_distance
        x, y, heading = goal.tolist()
        _, beside = rotate(float(pose[0]) - x, float(pose[1]) - y, -heading)
        dx, dy = rotate(0.0, min(max(beside, -most), most), heading)
        return np.array((x + dx, y + dy, heading))

    def _look_behind(self, state: GuideState, now: Situation, search: PathSearch) -> bool:
        """Begin to look whether there is a path but for what moves, where that was in the way."""
        if now.moving is None or search.only_tells or len(search.circles) != len(now.circles):
            return False
        still = search.circles[~now.circles[:, 3:].any(axis=1)]
        state.search = self._search(state, now, search.pose, search.lead, search.same_goal, still)
        state.search.only_tells = search.reason
        return True

    def _new_shuttle(self, state: GuideState, now: Situation) -> Array | None:
        """Pose (3,) at which a shuttle that begins here turns back; none where none is begun."""
        o = self._options
        beside = now.capabilities.tolerances.turn_distance < now.distance < o.near_goal
        if state.shuttle is not None or not beside or state.shuttles >= o.shuttles:
            return None
        return self._shuttles.find(now, state.path_map)

    def advance(self, state: GuideState, now: Situation) -> tuple[bool, bool]:
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
                self.begin(state, now)
            elif none and now.moving is not None and now.moving.stays(state.yielded):
                state.yielded = 0.0
                self.begin(state, now)
            elif none and self._look_behind(state, now, search):
                pass
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
        can, centre = now.capabilities, state.turning_centre
        self._searcher.advance(search, state.place, can, centre, now.view)
        if search.stage is Stage.CHOSEN:
            # one more, in which it began
            steps = 1 + math.ceil(search.work / most)
            state.search_time = longest_lately(state.search_time, steps * self._dt)
        return work

    def _take_over(self, state: GuideState, now: Situation, search: PathSearch) -> bool:
        """Follow the path that was chosen, and tell whether it leads another way around."""
        previous, path, reason = state.path, search.path, search.reason
        if search.only_tells:
            path, reason = None, search.only_tells if path is None else BLOCKED
        if state.only_renews and previous is not None:
            left = previous.duration - state.place - self._options.switch_time
            if path is None or path.time > left - search.gear_time:
                return False
        if path is None:
            state.waiting = search.pose if state.waiting is None else state.waiting
            state.path, state.why_none = None, reason
            return previous is not None
        state.waiting = None
        free_turn, o, can = self._free_turn(search), self._options, now.capabilities
        path = self._from_rest(now, search, path)
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

    def _from_rest(self, now: Situation, search: PathSearch, path: GeometricPath) -> GeometricPath:
        """Give the path from where the robot stands if it brakes now, if its first line is clear.

        A robot that has come past the beginning would drive back to turn there.
        """
        rest = (now.goal + now.rest_error)[:2]
        begun = path.begun_at(rest)
        if begun is path or now.distance <= self._options.near_goal:
            return path
        line = begun.points[1] - rest
        samples = 2 + int(math.hypot(*line.tolist()) / self._options.lattice_sample)
        points = rest + np.linspace(0.0, 1.0, samples)[:, None] * line
        distances = distances_around(points, search.circles, search.path_map)
        around = float(distances[0])
        may_turn = self._is_round or around >= self._turning
        return begun if may_turn and distances.min() >= min(self._inflation, around) else path

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
