"""The search for a path as data: it is left after any part of the work, to go on in a later step.

For each clearance, the widest first, paths are looked for on the tangent graph, and on the lattice
before it where the map has one. The quickest path is taken, but for one on the same side of all
obstacles as the path that is driven, if that is hardly slower.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.capabilities import Capabilities
from kmpc_lite.control.path.look_times import look_times
from kmpc_lite.control.path.path_map import distance_around
from kmpc_lite.control.path.search_state import PathSearch, SearchObstacles, Stage
from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import Part, TangentSearch
from kmpc_lite.control.path.timed_path import same_side
from kmpc_lite.control.path.turning_centre import swing
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.body_paths import BodyPaths
    from kmpc_lite.control.world.sight.view import View

NO_EDGES = np.empty((0, 2), dtype=np.intp)


class PathSearcher:
    """Brings a search forward, part by part.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, area.
    options : GuidanceOptions
        In metres.
    """

    def __init__(self, problem: NavigationProblem, options: GuidanceOptions) -> None:
        _, _, x_min, x_max = problem.bounds
        self._options, self._radius = options, problem.robot_radius
        self._inflation = problem.inflation
        self._turning = problem.robot_radius - problem.half_width
        """What the robot needs beyond that to turn on the spot [m]; a round one nothing."""
        self._body = _body_paths(problem, options)
        self._plan_time = problem.horizon * problem.dt
        self._low, self._high = x_min[:2], x_max[:2]
        self._narrow = [options.narrow_clearance, options.least_clearance]

    def advance(
        self,
        search: PathSearch,
        place: float,
        capabilities: Capabilities,
        centre: Array | None,
        view: View | None = None,
    ) -> None:
        """Do one part of the work.

        Parameters
        ----------
        search : PathSearch
            Updated; at stage CHOSEN there is nothing left to do.
        place : float
            Where the robot is on the previous path [s].
        capabilities : Capabilities
            Speeds and clearance, as they are now.
        centre : ndarray or None
            Turning centre (2,) that the search is made for.
        view : View, optional
            What scans have shown: a gear in which the robot must stop to look takes longer.
        """
        path_map = search.path_map
        if path_map is not None and not path_map.is_ready:
            path_map.prepare(search.pose, search.goal)
        elif search.stage is Stage.OBSTACLES:
            search.centre = centre
            search.obstacles = self._gather(search, swing(centre))
            search.reason = self._why_blocked(search, capabilities.tolerances.enter_distance)
            if search.reason:
                _choose(search, None, True)
                return
            clearances = self._clearances(capabilities.clearance, centre)
            if path_map is not None and path_map.coarseness:
                # cells stand out of what was hit in them, on either side by half of that in the
                # mean: from nearer the robot sees whether it fits
                clearances.append(clearances[-1] - 0.5 * path_map.coarseness)
            search.clearances = clearances[-2:] if search.narrow else clearances
            self._try_next_clearance(search, place, capabilities, view)
        elif search.stage is Stage.LINKED and path_map is not None and path_map.lattice is not None:
            path_map.lattice.find(*self._on_lattice(search))
            search.stage = Stage.STRAIGHTEN
        elif search.stage is Stage.STRAIGHTEN:
            self._straighten(search)
        elif search.stage is Stage.LATTICE and search.lattice_path is None:
            self._try_next_clearance(search, place, capabilities, view)
        elif search.stage is Stage.LATTICE:
            self._begin_graph(search, capabilities, view)
            self._look(search, place, capabilities, view)
        elif search.stage is Stage.TANGENTS:
            self._look(search, place, capabilities, view)

    def _clearances(self, at_speed: float, centre: Array | None) -> list[float]:
        """Clearances that are tried [m], the widest first."""
        widest = self._options.wide_clearance
        clearances = [widest, *self._narrow]
        if at_speed > widest:
            clearances = [at_speed, *clearances]
        if self._turning:
            # first where it may turn anywhere, then where it just fits through
            wider = [c + self._turning + swing(centre) for c in clearances]
            beside = 0.0 if centre is None else abs(float(centre[1]))
            return wider + [c + beside for c in (widest, *self._narrow)]
        if centre is None:
            return clearances
        # the pose swings around the turning centre: where that is too wide, only as far as it lies
        # beside it
        beside = abs(float(centre[1]))
        around = swing(centre)
        return [c + around for c in clearances] + [c + beside for c in self._narrow]

    def _gather(self, search: PathSearch, around: float) -> SearchObstacles:
        """Put circles and corners into one list; `around` is the swing of the tracked pose [m]."""
        circles, path_map = search.circles, search.path_map
        pose, goal = search.pose, search.goal
        centres, sizes, edges, landmarks = circles[:, :2], circles[:, 2], NO_EDGES, circles[:, :2]
        to_pose, to_goal = (np.hypot(*(centres - p[:2]).T) for p in (pose, goal))
        if path_map is not None:
            corners = path_map.corners
            centres = np.concatenate([centres, corners.points])
            to_pose = np.concatenate([to_pose, corners.to_centre(pose[:2])])
            to_goal = np.concatenate([to_goal, corners.to_centre(goal[:2])])
            sizes = np.concatenate([sizes, corners.rounding])
            edges = corners.edges + len(circles)
            landmarks = np.concatenate([landmarks, path_map.landmarks])
        # the outermost of robot and goal widen the area
        low = np.minimum(self._low + around, np.minimum(pose, goal)[:2])
        high = np.maximum(self._high - around, np.maximum(pose, goal)[:2])
        most = np.maximum(np.minimum(to_pose, to_goal) - self._options.back_off, 0.0)
        return SearchObstacles(centres, sizes, edges, landmarks, most, np.concatenate([low, high]))

    def _why_blocked(self, search: PathSearch, tolerance: float) -> str:
        """Why the robot cannot stand within a tolerance [m] of its goal; nothing if it can."""
        if self._body is not None:
            return self._body.why_blocked(search, tolerance)
        distance = distance_around(search.target[:2], search.circles, search.path_map)
        search.goal_clearance = distance - self._inflation
        if distance < self._radius:
            return "the goal lies so near to an obstacle that the robot would touch it"
        if distance < self._inflation - tolerance:
            return "the goal lies within the margin of an obstacle"
        return ""

    def _try_next_clearance(
        self, search: PathSearch, place: float, capabilities: Capabilities, view: View | None
    ) -> None:
        """Begin with the next clearance; where none is left there is no path."""
        obstacles = search.obstacles
        if obstacles is None or not search.clearances:
            search.reason = (
                "too many obstacles are in the way to find a path around them"
                if search.gave_up
                else "no passage to the goal is wide enough"
            )
            search.clearance = search.instead_clearance
            _choose(search, search.instead, True)
            return
        search.clearance = search.clearances.pop(0)
        search.best = search.same_gear = None
        path_map = search.path_map
        if path_map is not None and path_map.lattice is not None:
            path_map.lattice.link(*self._on_lattice(search))
            search.stage = Stage.LINKED
            if not path_map.later:
                self._straighten(search)
            return
        self._begin_graph(search, capabilities, view)
        self._look(search, place, capabilities, view)

    def _on_lattice(self, search: PathSearch) -> tuple[Array, Array, float, Array, Array]:
        """Between what, and how far from what, a path on the lattice is looked for."""
        assert search.obstacles is not None
        inflation = self._inflation + search.clearance
        return search.pose, search.goal, inflation, search.circles, search.obstacles.area

    def _straighten(self, search: PathSearch) -> None:
        """Pull the lattice's path straight, if there is one."""
        assert search.path_map is not None and search.path_map.lattice is not None
        search.lattice_path = search.path_map.lattice.path(*self._on_lattice(search))
        search.stage = Stage.LATTICE

    def _begin_graph(
        self, search: PathSearch, capabilities: Capabilities, view: View | None
    ) -> None:
        """Begin a search on the tangent graph."""
        obstacles = search.obstacles
        assert obstacles is not None
        straight = np.stack([search.pose[:2], search.goal[:2]])
        points = straight if search.lattice_path is None else search.lattice_path.points
        inflated = obstacles.sizes + self._inflation + search.clearance
        query = PathQuery(
            search.pose,
            search.goal,
            obstacles.centres,
            np.clip(inflated, 0.0, obstacles.most),
            obstacles.edges,
            obstacles.area,
            capabilities.forward,
            capabilities.backward_share,
            search.lattice_path,
            look_times(view, capabilities, points, self._plan_time),
        )
        search.tangents = TangentSearch(query, self._options)
        search.stage = Stage.TANGENTS

    def _look(
        self, search: PathSearch, place: float, capabilities: Capabilities, view: View | None
    ) -> None:
        """Bring the search on the tangent graph to the end of a part."""
        tangents = search.tangents
        assert tangents is not None
        while True:
            path = tangents.advance()
            if path is not None and self._takes(search, path, place):
                return
            if tangents.part is Part.NOTHING:
                search.gave_up = search.gave_up or tangents.gave_up
                if search.best is not None:
                    _choose(search, _preferred(search), True)
                else:
                    self._try_next_clearance(search, place, capabilities, view)
                return
            if tangents.part is not Part.NEXT:
                return

    def _takes(self, search: PathSearch, path: GeometricPath, place: float) -> bool:
        """Whether a path that was found ends the search: it or the quickest is chosen."""
        obstacles = search.obstacles
        assert obstacles is not None
        if self._body is not None and not self._body.fits(path, search):
            if search.instead is None:
                search.instead, search.instead_clearance = path, search.clearance
            return False
        landmarks, avoid = obstacles.landmarks, search.avoid
        if avoid is not None and same_side(avoid, search.avoid_place, path, search.pose, landmarks):
            if search.instead is None:
                search.instead, search.instead_clearance = path, search.clearance
            return False
        best, o = search.best, self._options
        previous = search.previous
        if previous is not None and search.same_gear is None:
            search.same_gear = path if path.reverse == previous.geometry.reverse else None
        longest = max(o.switch_time, search.gear_time)
        if best is not None and path.time > best.time + longest + o.switch_share * best.time:
            _choose(search, _preferred(search), True)
            return True
        search.best = best or path
        if previous is None:
            _choose(search, path, True)
            return True
        if same_side(previous, place, path, search.pose, landmarks):
            _choose(search, path, False)
            return True
        return False


def _body_paths(problem: NavigationProblem, options: GuidanceOptions) -> BodyPaths | None:
    """What looks whether a robot that is not round fits on a path."""
    if problem.footprint is None:
        return None
    # here, since most robots are round
    from kmpc_lite.control.path.body_paths import BodyPaths

    return BodyPaths(problem, problem.footprint, options)


def _preferred(search: PathSearch) -> GeometricPath | None:
    """The quickest path; or one that needs no change of gear, where it is hardly slower."""
    best, same = search.best, search.same_gear
    if best is None or same is None or same.time > best.time + search.gear_time:
        return best
    return same


def _choose(search: PathSearch, path: GeometricPath | None, switched: bool) -> None:
    """End a search; what it was made of is not needed any more."""
    search.path, search.switched, search.stage = path, switched, Stage.CHOSEN
    search.tangents, search.lattice_path = None, None
