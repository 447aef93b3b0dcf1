"""A reference around obstacles, so that the controller is never trapped behind one.

The way is the quickest on the tangent graph of the inflated circles; it is looked for anew only
when the map, the goal or the robot's place gives a reason: at once for a new map or goal, over a
few steps while the robot drives on where it has only strayed. Between times the robot is located on
it, and the poses of the coming stages are read off; all for the point about which it turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.guidance.capabilities import clearance_at_speed, drivable_speeds
from kmpc_lite.control.guidance.goal_checker import GoalChecker, goal_tolerances
from kmpc_lite.control.guidance.moving_obstacles import MovingObstacles
from kmpc_lite.control.guidance.progress_checker import ProgressChecker
from kmpc_lite.control.guidance.reference import Guidance
from kmpc_lite.control.guidance.tangent_graph import NO_EDGES, GeometricPath, paths_in_parts
from kmpc_lite.control.guidance.timed_path import TimedPath, same_side
from kmpc_lite.control.guidance.turning_centre import SAME, point_of, seen_from, turning_centre
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.margins.margins import Margins
    from kmpc_lite.control.obstacles.solids import Solids
    from kmpc_lite.model.koopman import KoopmanModel

CLEARANCES = (0.06, 0.03, 0.005)
"""Distances beyond the problem's margin that a way keeps [m]; the next one is tried where there is
no way."""
SPEED_SHARE = (1.0, 0.9)
"""Share of the bounds at which the way is timed: speed, rate of turn."""
SLOWEST = 1e-6
"""A robot that cannot turn, or drive, is taken for one that does so this slowly [m/s, rad/s]: times
are finite."""
LEAD = 0.2
"""How far the reference runs ahead of the robot [s]."""
OFF_WAY = (0.08, 0.15)
"""Distance from the way at which a new one is looked for: share of the distance to the goal, most
[m]; the least is the zone's."""
NEAR_GOAL, MOST_PARTS = 0.3, 3
"""Every search after the second so near to the goal [m] takes one part more at a step, to this
number: a robot that does not get parked, since it lags more than its model knows, is soon where no
way began."""
LOST = 0.5
"""Distance from the way at which the new one is needed at once [m]: the robot was carried off."""
PATIENCE = 0.3
"""Least time between two new ways for the same map [s]."""
RETRY = 0.5
"""Time between two searches where there is no way [s]."""
MOVED = 0.01
"""How far an obstacle must be from where it was expected to give a reason for a new way [m]."""
ALLOWED = np.array([MOVED, MOVED, 0.0, 0.0, 0.0])
"""The same for x, y, radius, vx, vy."""
FREE_TURN = np.pi / 3
"""How much of the first turn is made while driving on a long way [rad]."""
LONG = 0.5
"""A way over which the whole `FREE_TURN` may be made [m]."""
FREE_ROOM = 0.6
"""Room that it needs [m]: a robot backs up for it, and in a narrow place turns on the spot
instead."""
FLICKER = (0.5, 0.1)
"""How much quicker another way around must be to be taken: seconds, and share of what is left."""
LAST_STRETCH = 0.5
"""Before the goal's position is reached [s]: the last turn is not begun yet."""


class Guide:
    """Finds ways, and keeps to one.

    Parameters
    ----------
    problem : NavigationProblem
        Bounds, radius and margin, horizon and period.
    speeds : ndarray, optional
        See `set_speeds`; the command bounds where not given.
    clock : callable
        Gives the time [s] that `until` is on.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        speeds: Array | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        self._clock = clock
        u_min, u_max, x_min, x_max = problem.bounds
        self._radius, self._keep = problem.robot_radius, problem.robot_radius + problem.margin
        self._area = np.concatenate([x_min[:2], x_max[:2]])
        self.set_speeds(
            np.array([u_max[0], -u_min[0], min(u_max[1], -u_min[1])]) if speeds is None else speeds
        )
        self._times = problem.dt * np.arange(problem.horizon + 1)
        self._ahead = LEAD + self._times
        self._problem, self._dt = problem, problem.dt
        self._parking, self._stand = GoalChecker(), ProgressChecker()
        self._point: Array | None = None
        self._swing, self._room, self._shifted, self._learned = 0.0, 0.0, False, False
        self.reset()

    def learn(self, model: KoopmanModel, margins: Margins | None) -> None:
        """Take over what a model knows: the robot's speeds, its turning point, the noise of its pose, and the room that margins ask for."""
        self.set_speeds(drivable_speeds(model, self._problem))
        if self._learned and "adaptation" in model.info:
            return  # what is learned while driving tells of speeds only
        self._learned = True
        self.set_turning_centre(turning_centre(model, self._problem))
        self._parking.zone = goal_tolerances(model)
        # a robot without lag is steered back before it needs the room
        self._room = (
            0.0
            if margins is None or not model.history
            else clearance_at_speed(model, self._problem, margins)
        )

    def set_speeds(self, speeds: Array) -> None:
        """Time the coming ways by what the robot can do: ahead, backwards [m/s], rate of turn [rad/s], (3,); `pace.drivable_speeds`."""
        ahead, back, turn = speeds.tolist()
        ahead, turn = max(ahead, SLOWEST), max(turn, SLOWEST)
        share = np.array(SPEED_SHARE)
        self._gears = share * (ahead, turn), share * (back, turn)
        # arcs that make room are driven in either gear: the slower one counts
        self._speed = self._gears[1] if 0.0 < back < ahead else self._gears[0]
        self._backward = back / ahead

    def set_turning_centre(self, point: Array | None) -> None:
        """Plan for a point (2,) of the robot, ahead and to the left [m], about which it turns; `turning_centre.turning_centre`."""
        known, new = (np.zeros(2) if p is None else p for p in (self._point, point))
        if math.hypot(*(new - known)) < SAME:
            return
        self._point, self._swing = point, math.hypot(*new)
        # the way is kept until there is one for the new point
        self._shifted = True

    def _clearances(self) -> list[float]:
        """Distances beyond the margin that a way keeps [m], the widest first."""
        wide = [self._room, *CLEARANCES] if self._room > CLEARANCES[0] else list(CLEARANCES)
        if self._point is None:
            return wide
        # the pose swings around the point that drives: where that is too wide, only as far as it
        # lies beside it
        return [c + self._swing for c in wide] + [
            c + abs(float(self._point[1])) for c in CLEARANCES[1:]
        ]

    def reset(self) -> None:
        """Forget the way."""
        self._path: TimedPath | None = None
        self._search: Iterator[bool | None] | None = None
        self._urgent, self._until, self._attempts = False, math.inf, 0
        self._goal = np.full(3, np.nan)
        self._circles, self._resting = np.empty((0, 5)), b""
        self._solids: Solids | None = None
        self._escape = -1
        self._waiting: Array | None = None
        self._turning, self._age = False, 0.0
        self.clearance = self._tried = math.inf
        """What the way keeps beyond the margin [m]: less where a passage is narrow."""
        self._stand.reset()
        self._parking.reset()

    def reference(
        self,
        pose: Array,
        goal: Array,
        circles: Array,
        solids: Solids | None = None,
        rest: Array | None = None,
        until: float = math.inf,
    ) -> Guidance:
        """Give the reference of the coming stages.

        Parameters
        ----------
        pose, goal : ndarray
            Poses (3,) [m, m, rad].
        circles : ndarray
            (M, 5) rows x, y, radius, vx, vy, now.
        solids : Solids, optional
            Polygons, walls and grids; another object is another map.
        rest : ndarray, optional
            Pose (3,) at which the robot would stand if it braked now; where it is, if not given.
        until : float
            When to leave a search that is needed at once to the next step [s], on the guide's
            clock; the old way is kept meanwhile, and where there was none the robot stands.
        """
        self._until = until
        point = self._point
        if point is None:
            return self._follow(pose, goal, circles, solids, rest, goal)
        stand = None if rest is None else point_of(rest, point)
        guidance = self._follow(
            point_of(pose, point), point_of(goal, point), circles, solids, stand, goal
        )
        return replace(guidance, states=seen_from(guidance.states, -point))

    def _follow(
        self,
        pose: Array,
        goal: Array,
        circles: Array,
        solids: Solids | None,
        rest: Array | None,
        target: Array,
    ) -> Guidance:
        """Give what `reference` does, for poses of the turning point; `target` is the goal of the tracked one."""
        self._age += self._dt
        error = pose - goal
        error[2] -= 2 * np.pi * round(float(error[2]) / (2 * np.pi))
        distance = math.hypot(error[0], error[1])
        at_rest = error
        if rest is not None:
            at_rest = error + (rest - pose)
        # a last turn on the spot begins where the robot comes to a stop
        near = (
            distance
            if rest is None or self._turning
            else max(distance, math.hypot(at_rest[0], at_rest[1]))
        )
        zone = self._parking.zone
        self._turning = near <= (zone.keep if self._turning else zone.close)
        traffic = (
            MovingObstacles(circles, self._keep + self._swing, self._speed, solids)
            if circles[:, 3:].any()
            else None
        )
        place, off = (
            (0.0, 0.0)
            if self._path is None
            else self._path.locate(pose, self._path.drive_end if self._turning else 0.0)
        )
        strayed = self._strayed(off, place, distance)
        at_once = (
            off > LOST or self._is_new(target, circles, solids) or self._blocked(traffic, place)
        )
        if at_once:
            self._stand.forget()
        if at_once or (strayed and self._search is None):
            self._search = self._look_for_way(pose.copy(), goal, circles, solids, traffic, target)
            self._attempts = self._attempts + 1 if distance < NEAR_GOAL and not at_once else 0
        self._urgent = self._urgent or at_once
        outcome = self._go_on(min(max(self._attempts - 1, 1), MOST_PARTS))
        refreshed, switched = outcome is not None, bool(outcome)
        if refreshed and self._path is not None:
            place, _ = self._path.locate(pose)
        path = self._path
        if path is None:
            wait = pose if self._waiting is None else self._waiting
            states = np.tile(np.array([wait[0], wait[1], pose[2]]), (len(self._times), 1))
            if traffic is not None and not traffic.leaves_alone(pose):
                self._escape, states = traffic.escape(pose, self._escape, self._times)
            return Guidance(
                states, self._urgent, False, wait[None, :2], np.inf, refreshed, switched
            )
        path.place = place = (
            max(place, path.drive_end) if self._turning else min(place, path.drive_end)
        )
        left = path.duration - place
        hold = self._parking.hold(error, at_rest) and (
            traffic is None or traffic.leaves_alone(pose)
        )
        pace = 1.0 if traffic is None else traffic.pace(path, place)
        if traffic is not None and pace is None:
            self._escape, states = traffic.escape(pose, self._escape, self._times)
            return Guidance(states, True, hold, path.points, left, refreshed, switched)
        self._escape = -1
        times = self._ahead * (pace or 0.0)
        times += place
        if not self._turning and place > path.drive_end - LAST_STRETCH:
            np.minimum(times, path.drive_end, out=times)
        states = path.at(times)
        turns = round((float(pose[2]) - path.heading_at(place)) / (2 * np.pi))
        if turns:
            states[:, 2] += 2 * np.pi * turns
        return Guidance(states, True, hold, path.points, left, refreshed, switched)

    def _is_new(self, goal: Array, circles: Array, solids: Solids | None) -> bool:
        """Whether the goal or the map is another one than the way was made for."""
        if (
            len(circles) != len(self._circles)
            or solids is not self._solids
            or goal.tolist() != self._goal.tolist()
        ):
            return True
        if not len(circles):
            return False
        if circles.tobytes() == self._resting:
            return False
        change = circles - self._circles
        change[:, :2] -= self._age * self._circles[:, 3:]
        return bool((np.abs(change, out=change) > ALLOWED).any())

    def _strayed(self, off: float, place: float, distance: float) -> bool:
        """Whether the robot's place gives a reason to look for a way: it is off the one it has, stands still on it, or has none."""
        if self._path is None:
            return self._age >= RETRY
        self._stand.see(self._path.duration - place)
        if self._turning:
            return False
        if self._shifted:
            return True
        share, most = OFF_WAY
        too_far = self._age > PATIENCE and off > min(
            max(self._parking.zone.off_way, share * distance), most
        )
        return self._stand.wait(self._dt) or too_far

    def _blocked(self, traffic: MovingObstacles | None, place: float) -> bool:
        """Whether something that moves will be in the way."""
        if traffic is None or self._path is None or self._turning:
            return False
        return self._age > PATIENCE and traffic.blocks(self._path, place)

    def _go_on(self, parts: int) -> bool | None:
        """Look on for a way; none while the search goes on or where there is none, then whether it goes another way around."""
        outcome = None
        while self._search is not None:
            outcome = next(self._search)
            if outcome is not None:
                self._search, self._urgent = None, False
            parts -= 1
            if (parts <= 0 and not self._urgent) or (
                self._until < math.inf and self._clock() > self._until
            ):
                break
        return outcome

    def _look_for_way(
        self,
        pose: Array,
        goal: Array,
        circles: Array,
        solids: Solids | None,
        traffic: MovingObstacles | None,
        target: Array,
    ) -> Iterator[bool | None]:
        """Look for a way in parts, none after each; at last yield whether it goes another way around than the one before."""
        previous, same_goal = self._path, bool((target == self._goal).all())
        self._goal, self._circles, self._solids, self._age = (
            target.copy(),
            circles.copy(),
            solids,
            0.0,
        )
        self._shifted = False
        # circles at rest that are the same to the last bit are known again in a moment
        self._resting = b"" if traffic is not None else circles.tobytes()
        goal = goal.copy()
        stuck = self._stand.stuck
        if traffic is not None:
            circles = traffic.where_met(pose)
        keep_to = previous if same_goal and not stuck else None
        choice: tuple[GeometricPath | None, bool] | None = None
        for choice in self._choices(pose, goal, circles, solids, keep_to):
            if choice is None:
                yield None
        yield None
        way, switched = choice or (None, True)
        if way is None:
            if self._waiting is None:
                self._waiting = pose
            self._path = None
            yield previous is not None
            return
        self._waiting = None
        length = float(np.hypot(*np.diff(way.points, axis=0).T).sum())
        # a robot that is stuck turns on the spot before it drives
        free = (
            0.0
            if stuck
            else FREE_TURN
            * min(1.0, length / LONG, self._room_around(pose, circles, solids) / FREE_ROOM)
        )
        gear = self._gears[way.reverse]
        self._path = TimedPath(way, pose, goal, gear, free)
        self.clearance = max(self._tried - self._swing, 0.0)
        other = switched or previous is None or not same_goal
        place, self._path.place = self._path.locate(pose)[0], 0.0
        self._stand.begin(self._path.duration - place, free / float(gear[1]), other or stuck)
        yield other

    def _room_around(self, pose: Array, circles: Array, solids: Solids | None) -> float:
        """Distance to what is nearest, beyond what must be kept [m], or zero."""
        room = float((np.hypot(*(circles[:, :2] - pose[:2]).T) - circles[:, 2]).min(initial=np.inf))
        if solids is not None:
            room = min(room, float(solids.whole.least(pose[None, :2])[0]))
        return max(room - self._keep, 0.0)

    def _choices(
        self,
        pose: Array,
        goal: Array,
        circles: Array,
        solids: Solids | None,
        previous: TimedPath | None,
    ) -> Iterator[tuple[GeometricPath | None, bool] | None]:
        """Pick a way (none: there is none), and tell whether it goes another way around than the previous one; none after each part."""
        centres, edges, round_about = circles[:, :2], NO_EDGES, circles[:, :2]
        to_pose, to_goal, to_target = (
            np.hypot(*(centres - point[:2]).T) for point in (pose, goal, self._goal)
        )
        sizes = circles[:, 2]
        if solids is not None:
            corners = solids.corners
            centres = np.concatenate([centres, corners.points])
            to_pose, to_goal, to_target = (
                np.concatenate([a, corners.to_centre(p[:2])])
                for a, p in ((to_pose, pose), (to_goal, goal), (to_target, self._goal))
            )
            sizes, edges = np.concatenate([sizes, corners.rounding]), corners.edges + len(circles)
            round_about = np.concatenate([circles[:, :2], corners.middles])
        maze = None if solids is None else solids.maze
        if maze is not None:
            round_about = np.concatenate([round_about, maze.landmarks])
        if (to_target < sizes + self._radius).any() or (
            maze is not None and maze.room(self._goal[:2]) < self._radius
        ):
            yield None, True
            return
        # the outermost of robot and goal widen the area
        area = np.concatenate(
            [
                np.minimum(self._area[:2] + self._swing, np.minimum(pose, goal)[:2]),
                np.maximum(self._area[2:] - self._swing, np.maximum(pose, goal)[:2]),
            ]
        )
        nearest = np.minimum(to_pose, to_goal) - 1e-3
        for clearance in self._clearances():
            self._tried = clearance
            radii = np.clip(sizes + self._keep + clearance, 0.0, np.maximum(nearest, 0.0))
            best: GeometricPath | None = None
            route = (
                None
                if maze is None
                else maze.route(pose, goal, self._keep + clearance, circles, area)
            )
            if maze is not None:
                yield None
                if route is None:
                    continue
            for way in paths_in_parts(
                centres, radii, pose, goal, area, self._gears[0], self._backward, edges, route
            ):
                if way is None:
                    yield None
                    continue
                if best is not None and way.time > best.time + FLICKER[0] + FLICKER[1] * best.time:
                    break
                best = best or way
                if previous is None or same_side(previous, way, pose, round_about):
                    yield way, previous is None
                    return
            if best is not None:
                yield best, True
                return
        yield None, True
