"""The search for a path, brought forward by a few parts in each step, and its path taken over."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kmpc_lite.control.clock import longest_lately
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import VELOCITY
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.capabilities import follows_poses, swing
from kmpc_lite.control.path.distance_grid import SAMPLE
from kmpc_lite.control.path.planner import NEAR_GOAL, Known, Path, PathRequest, Planner, TimedPath
from kmpc_lite.control.path.situation import BLOCKED, GuideState, Search, Situation
from kmpc_lite.control.path.ways import outline_distances
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn, rotate
from kmpc_lite.types import Array

GOAL_SLACK = 0.5
"""A path that begins near the goal may end beside it, by this share of the distance at which the
last turn may begin: what is left to the side takes two turns."""
STANDS = 0.01  # speed below which a robot that follows poses stands [m/s]
URGENT_PARTS = 60
"""Most parts of a search that the robot needs at once that are done in one step. Most searches end
sooner; among very many obstacles the robot drives on as before, or stands, for a step more, which
else would come late."""
GEAR_TIME = 2.0
"""How much slower a path among what scans show may be that needs no change of gear [s]."""
FREE_TURN_LENGTH = 0.5
"""Length of a path on which the robot may make the whole free turn; on a shorter path it makes a
part of it in proportion [m]."""
FREE_TURN_CLEARANCE = 0.6
"""Clearance that the whole free turn needs: the robot may back up in it [m]."""


class SearchDriver:
    """Begins searches, brings them forward, and takes over what they find."""

    def __init__(
        self,
        problem: NavigationProblem,
        options: GuidanceOptions,
        clock: Callable[[], float],
        planner: Planner,
    ) -> None:
        self._options, self._clock = options, clock
        self._dt, self._by_poses = problem.dt, follows_poses(problem)
        self._turning = problem.robot_radius + problem.margin
        self._area = np.stack([problem.x_min[:2], problem.x_max[:2]])
        self._inflation, self._is_round = problem.inflation, problem.footprint is None
        self._footprint = problem.footprint
        self._radius, self._margin = problem.body_radius, problem.margin
        middles = np.zeros((1, 2)) if problem.footprint is None else problem.footprint.circles
        self._outline = np.column_stack([middles, np.full(len(middles), self._radius)])
        self._planner, self._parts, self._locate = planner, 0, library.locate
        self._asked: PathRequest | None = None

    def begin(self, state: GuideState, now: Situation, lead: float = 0.0) -> None:
        """Begin a search from where the robot will be on its path after a time [s].

        One that is under way is given up.
        """
        start = now.pose.copy()
        if lead > 0.0 and state.path is not None:
            start = state.path.at(np.array([state.place + lead]))[0]
            start[2] -= nearest_turn(float(start[2] - now.pose[2]))
        same_goal = bool((now.target == state.goal).all())
        known = None
        state.known_solids, state.coarseness = now.task.solids, 0.0
        if (view := now.task.view) is not None:
            state.known_solids, state.coarseness = view.solids(now.task.solids)
            blind = view.blind_turn(0.0), view.blind_turn(math.pi)
            known = Known(*view.unknown_cells(), blind, state.coarseness)
        state.goal, state.circles = now.target.copy(), now.told.copy()
        state.solids, state.age, state.centre_moved = now.task.solids, 0.0, False
        can, progress = now.capabilities, state.progress
        driven = None
        if state.path is not None and same_goal and not progress.is_stuck:
            driven = state.path.route(start, state.place, 0.0)
        request = PathRequest(
            start=start,
            goal=self._aim(now, start).copy(),
            target=state.goal,
            centre=state.turning_centre,
            circles=now.met(state.yielded),
            solids=state.known_solids,
            outline=self._outline,
            footprint=self._footprint,
            inflation=self._inflation,
            area=self._area,
            forward=can.forward,
            backward=can.backward,
            clearance=can.clearance,
            known=known,
            driven=driven,
            tried=state.tried if same_goal else (),
            turned=state.turned,
            gear_time=0.0 if now.task.view is None else GEAR_TIME,
            curvature=now.task.curvature,
            curving=can.curving,
            steering_lag=can.steering_lag,
            gear=math.copysign(1.0, now.task.speed) if abs(now.task.speed) > STANDS else 0.0,
        )
        self._search(state, now, Search(request, same_goal, progress.is_stuck, lead))

    def _search(self, state: GuideState, now: Situation, search: Search) -> None:
        """Begin a search; it has ended already where the robot cannot stand at its goal."""
        state.search, request = search, search.request
        of_pose = replace(request, centre=None)
        distance = float(outline_distances(of_pose, request.target[None])[0]) + self._radius
        if self._is_round:
            search.goal_clearance = distance - self._inflation
        if distance < self._radius:
            search.refusal = "the goal lies so near to an obstacle that the robot would touch it"
        elif distance < self._radius + self._margin - now.capabilities.tolerances.enter_distance:
            search.refusal = "the goal lies within the margin of an obstacle"
        self._begin_planner(search)

    def _begin_planner(self, search: Search) -> None:
        self._asked, self._parts = search.request, 0
        if not search.refusal:
            self._planner.begin(search.request)

    def _found(self, search: Search) -> Path | str | None:
        """What a search has found; a planner that was asked something else since does it again."""
        if search.refusal:
            return search.refusal if search.parts else None
        if self._asked is not search.request or self._parts > search.parts:
            self._begin_planner(search)
        while self._parts < search.parts:
            self._planner.advance(1)
            self._parts += 1
        return self._planner.path()

    def _aim(self, now: Situation, pose: Array) -> Array:
        """Pose (3,) at which a path from a pose ends: near the goal, a little beside it.

        What lies beside the robot it can only reach by turning away and back.
        """
        goal = now.goal
        if self._by_poses or now.distance > NEAR_GOAL:
            return goal
        most = GOAL_SLACK * now.capabilities.tolerances.turn_distance
        x, y, heading = goal.tolist()
        _, beside = rotate(float(pose[0]) - x, float(pose[1]) - y, -heading)
        dx, dy = rotate(0.0, min(max(beside, -most), most), heading)
        return np.array((x + dx, y + dy, heading))

    def _look_behind(self, state: GuideState, now: Situation, search: Search, why: str) -> bool:
        """Begin to look whether there is a path but for what moves, where that was in the way."""
        request = search.request
        if now.moving is None or search.only_tells or len(request.circles) != len(now.task.circles):
            return False
        still = request.circles[~now.task.circles[:, VELOCITY].any(axis=1)]
        asked = replace(request, circles=still)
        again = Search(asked, search.same_goal, search.stuck, search.lead, only_tells=why)
        self._search(state, now, again)
        return True

    def advance(self, state: GuideState, now: Situation) -> tuple[bool, bool]:
        """Bring the search forward: nearly always to its end if urgent, else by a few parts."""
        refreshed = switched = False
        waits = self._by_poses and abs(now.task.speed) <= STANDS
        parts = URGENT_PARTS if state.urgent or waits else self._options.hurried_parts
        while (search := state.search) is not None:
            found = self._found(search)
            if (
                isinstance(found, str)
                and now.moving is not None
                and now.moving.stays(state.yielded)
            ):
                state.yielded = 0.0
                self.begin(state, now)
            elif isinstance(found, str) and self._look_behind(state, now, search, found):
                pass
            elif found is not None and state.age < search.lead - 0.5 * self._dt:
                break  # the robot is on its way to where the path begins
            elif found is not None:
                refreshed, switched = True, self._take_over(state, now, search, found)
                state.search, state.urgent = None, False
            else:
                parts -= self._do_part(state, search) - 1
            parts -= 1
            if parts <= 0 or (now.task.until < math.inf and self._clock() > now.task.until):
                break
        return refreshed, switched

    def _do_part(self, state: GuideState, search: Search) -> int:
        """Do a part of a search; return how many quanta it took."""
        quanta = 1 if search.refusal else self._planner.advance(1)
        self._parts = search.parts = search.parts + 1
        search.quanta += quanta
        if self._found(search) is not None:
            steps = 1 + math.ceil(search.quanta / self._options.hurried_parts)  # it began in one
            state.search_time = longest_lately(state.search_time, steps * self._dt)
        return quanta

    def _take_over(
        self, state: GuideState, now: Situation, search: Search, found: Path | str
    ) -> bool:
        """Follow the path that was found, and tell whether it leads another way around."""
        previous, request, can = state.path, search.request, now.capabilities
        if search.only_tells:
            found = search.only_tells if isinstance(found, str) else BLOCKED
        if isinstance(found, str):
            # what scans show at the goal may go until the robot comes there
            may_go = search.refusal and search.same_goal and now.task.view is not None
            drives_on = may_go and abs(now.task.speed) > STANDS
            if previous is not None and (state.only_renews or drives_on):
                return False
            state.waiting = request.start if state.waiting is None else state.waiting
            state.path, state.why_none = None, found
            return previous is not None
        state.waiting = None
        path = found if self._by_poses else self._from_rest(now, request, found)
        speed = can.backward if (path.gears < 0).any() else can.forward
        free_turn = self._free_turn(search, path)
        timed = TimedPath(path, speed, free_turn, can.wheels, can.deceleration)
        if state.only_renews and previous is not None:
            left = previous.duration - state.place - self._options.switch_time
            if timed.duration > left - request.gear_time:
                return False
        state.path, state.leg = timed, 0.0
        state.path_clearance = max(path.clearance - swing(state.turning_centre), 0.0)
        state.goal_clearance = search.goal_clearance
        other = path.switched or previous is None or not search.same_goal
        begin, _ = self._locate(timed.timed, request.start, 0.0, 0.0)
        left, turn_time = state.path.duration - begin, free_turn / float(speed[1])
        state.progress.begin_path(left, turn_time, other or search.stuck)
        state.place, _ = self._locate(timed.timed, now.pose, 0.0, 0.0)
        return other

    def _from_rest(self, now: Situation, request: PathRequest, path: Path) -> Path:
        """Give the path from where the robot stands if it brakes now, if its first line is clear.

        A robot that has come past the beginning would drive back to turn there.
        """
        path = path.between_turns
        rest = (now.goal + now.rest_error)[:2]
        begun = path.begun_at(rest)
        if begun is path or now.distance <= NEAR_GOAL:
            return path
        line = begun.poses[2, :2] - rest
        samples = 2 + int(math.hypot(*line.tolist()) / SAMPLE)
        points = rest + np.linspace(0.0, 1.0, samples)[:, None] * line
        distances = request.distances(points)
        around = float(distances[0])
        may_turn = self._is_round or around >= self._turning
        return begun if may_turn and distances.min() >= min(self._inflation, around) else path

    def _free_turn(self, search: Search, path: Path) -> float:
        """Part of the first turn that is made while driving [rad]; none if the robot is stuck."""
        if self._by_poses or search.stuck:
            return 0.0
        request = search.request
        length = float(np.hypot(*np.diff(path.poses[1:-1, :2], axis=0).T).sum())
        nearest = float(request.distances(request.start[None, :2])[0])
        around = max(nearest - self._turning, 0.0)
        shares = length / FREE_TURN_LENGTH, around / FREE_TURN_CLEARANCE
        return self._options.free_turn * min(1.0, *shares)
