"""The planner that is used unless there is another one: tangent graphs, and a lattice for grids.

For each clearance, the widest first, paths are looked for on the tangent graph, and on the lattice
before it where the map has one. The cheapest path is taken: what it costs is its time, longer where
it is narrow or unknown, what it takes to switch to it, and the time that was lost on it before.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.options import (
    GuidanceOptions,
    SightOptions,
    lengths_from_radii,
    unit_length,
)
from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.path_map import PathMap, coarser, same_solids
from kmpc_lite.control.path.planner import Path, PathRequest, Route
from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import Part, TangentSearch
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.path.turning_centre import swing
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import angle_swept, wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.body_paths import BodyPaths

NO_EDGES = np.empty((0, 2), dtype=np.intp)
NO_WAY = "no passage to the goal is wide enough"
TOO_MANY = "too many obstacles are in the way to find a path around them"


class Stage(Enum):
    """What the next part of a search is."""

    OBSTACLES = auto()
    """Gather the obstacles, and begin with the widest clearance."""
    LINKED = auto()
    """Search the lattice, whose nodes are linked."""
    STRAIGHTEN = auto()
    """Pull the lattice's path straight, if there is one."""
    LATTICE = auto()
    """Take over the lattice's path, if there is one."""
    TANGENTS = auto()
    """Go on on the tangent graph."""
    CHOSEN = auto()
    """A path is chosen, or there is none."""


ON_LATTICE = Stage.OBSTACLES, Stage.LINKED, Stage.STRAIGHTEN
"""Where a search on a lattice that is made part by part does the most work."""


class Obstacles(NamedTuple):
    """Circles, and corners of solids, as the search sees them."""

    centres: Array
    """(M, 2) [m]."""
    sizes: Array
    """(M,) radii, before they are inflated [m]."""
    edges: Array
    """(S, 2) pairs of corners."""
    landmarks: Array
    """(L, 2) a point in each obstacle [m]."""
    most: Array
    """(M,) how far each may be inflated so that start and goal stay outside [m]."""
    area: Array
    """(4,) xmin, ymin, xmax, ymax [m]; start and goal lie in it."""


class TangentPlanner:
    """Looks for paths, part by part.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, horizon; in the robot's units.
    options : GuidanceOptions
        Lengths in radii.
    sight : SightOptions
        How fine the lattice is among what scans show.
    """

    def __init__(
        self, problem: NavigationProblem, options: GuidanceOptions, sight: SightOptions
    ) -> None:
        unit = unit_length(problem)
        self._options = lengths_from_radii(options, unit)
        sight = lengths_from_radii(sight, unit)
        self._coarse = coarser(self._options, sight.lattice_nodes, sight.lattice_step)
        self._inflation = problem.inflation
        self._turning = problem.robot_radius - problem.half_width
        """What the robot needs beyond that to turn on the spot [m]; a round one nothing."""
        self._body = _body_paths(problem, self._options)
        self._plan_time = problem.horizon * problem.dt
        self._narrow = [self._options.narrow_clearance, self._options.least_clearance]
        self._map: PathMap | None = None

    def begin(self, request: PathRequest) -> None:
        """Begin a search."""
        self._request, self._stage = request, Stage.OBSTACLES
        self._obstacles: Obstacles | None = None
        self._clearances: list[float] = []
        """Still to be tried [m]."""
        self._clearance = math.inf
        self._lattice_path: LatticePath | None = None
        self._tangents: TangentSearch | None = None
        self._best: Path | None = None
        """The cheapest path so far ..."""
        self._price = math.inf
        """... and its price [s]."""
        self._keeps_side = False
        """Whether one was found that passes all obstacles as the one driven does."""
        self._widest = 0.0
        """The largest clearance that is tried [m]."""
        self._gave_up = False
        """Whether more obstacles were in the way than a search takes."""
        self._found: Path | str | None = None
        self._map = self._map_of(request)

    def _map_of(self, request: PathRequest) -> PathMap | None:
        """The solids, prepared: as they were for the last search, where they are the same."""
        solids, known = request.solids, request.known
        if solids is None:
            return None
        limits = request.area[0], request.area[1]
        if known is not None:
            return PathMap(solids, self._coarse, known.coarseness, True, limits)
        if self._map is not None and same_solids(solids, self._map.solids):
            return self._map
        return PathMap(solids, self._options, later=not request.in_time)

    def path(self) -> Path | str | None:
        """What was found."""
        return self._found

    def advance(self, quanta: int) -> int:
        """Search on."""
        done = 0
        while done < quanta and self._found is None:
            done += self._weight
            self._do_part()
        return done

    @property
    def _weight(self) -> int:
        """How many quanta the next part counts as: long ones on a lattice as those of a step."""
        if self._map is not None and self._map.later and self._stage in ON_LATTICE:
            return self._options.hurried_parts
        if self._stage is Stage.TANGENTS and self._tangents is not None:
            return self._tangents.weight
        return 1

    def _do_part(self) -> None:
        """Do one part of the work."""
        request, path_map = self._request, self._map
        if path_map is not None and not path_map.is_ready:
            path_map.prepare(request.start, request.goal)
        elif self._stage is Stage.OBSTACLES:
            self._obstacles = self._gather(swing(request.centre))
            clearances = self._all_clearances(request.clearance, request.centre)
            if path_map is not None and path_map.coarseness:
                # cells stand out of what was hit in them, on either side by half of that in the
                # mean: from nearer the robot sees whether it fits
                clearances.append(clearances[-1] - 0.5 * path_map.coarseness)
            self._clearances, self._widest = clearances, clearances[0]
            self._try_next_clearance()
        elif self._stage is Stage.LINKED and path_map is not None and path_map.lattice is not None:
            path_map.lattice.find(*self._on_lattice())
            self._stage = Stage.STRAIGHTEN
        elif self._stage is Stage.STRAIGHTEN:
            self._straighten()
        elif self._stage is Stage.LATTICE and self._lattice_path is None:
            self._try_next_clearance()
        elif self._stage is Stage.LATTICE:
            self._begin_graph()
            self._look()
        elif self._stage is Stage.TANGENTS:
            self._look()

    def _all_clearances(self, at_speed: float, centre: Array | None) -> list[float]:
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

    def _gather(self, around: float) -> Obstacles:
        """Put circles and corners into one list; `around` is the swing of the tracked pose [m]."""
        request, path_map = self._request, self._map
        circles, pose, goal = request.circles, request.start, request.goal
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
        low = np.minimum(request.area[0] + around, np.minimum(pose, goal)[:2])
        high = np.maximum(request.area[1] - around, np.maximum(pose, goal)[:2])
        most = np.maximum(np.minimum(to_pose, to_goal) - self._options.back_off, 0.0)
        return Obstacles(centres, sizes, edges, landmarks, most, np.concatenate([low, high]))

    def _try_next_clearance(self) -> None:
        """Begin with the next clearance, unless none is left or a path is quick enough."""
        if not self._clearances or self._is_cheapest:
            self._choose()
            return
        self._clearance, self._keeps_side = self._clearances.pop(0), False
        path_map = self._map
        if path_map is not None and path_map.lattice is not None:
            path_map.lattice.link(*self._on_lattice())
            self._stage = Stage.LINKED
            if not path_map.later:
                self._straighten()
            return
        self._begin_graph()
        self._look()

    def _on_lattice(self) -> tuple[Array, Array, float, Array, Array]:
        """Between what, and how far from what, a path on the lattice is looked for."""
        assert self._obstacles is not None
        request, inflation = self._request, self._inflation + self._clearance
        return request.start, request.goal, inflation, request.circles, self._obstacles.area

    def _straighten(self) -> None:
        """Pull the lattice's path straight, if there is one."""
        assert self._map is not None and self._map.lattice is not None
        self._lattice_path = self._map.lattice.path(*self._on_lattice())
        self._stage = Stage.LATTICE

    def _begin_graph(self) -> None:
        """Begin a search on the tangent graph."""
        request, obstacles = self._request, self._obstacles
        assert obstacles is not None
        inflated = obstacles.sizes + self._inflation + self._clearance
        query = PathQuery(
            request.start,
            request.goal,
            obstacles.centres,
            np.clip(inflated, 0.0, obstacles.most),
            obstacles.edges,
            obstacles.area,
            request.forward,
            request.backward_share,
            self._lattice_path,
            self._look_times(),
        )
        self._tangents = TangentSearch(query, self._options)
        self._stage = Stage.TANGENTS

    def _look_times(self) -> tuple[float, float]:
        """How long the robot stops on its way to look, driving forwards, and backwards [s].

        Where no scanner looks in the direction in which it drives, it turns round to look, and
        back, each time it has come to the end of what it saw: that is as far as plans lead.
        """
        request, known = self._request, self._request.known
        if known is None or not any(known.blind_turns):
            return 0.0, 0.0
        points = np.stack([request.start[:2], request.goal[:2]])
        if self._lattice_path is not None:
            points = self._lattice_path.points
        speed, turn_rate = request.forward.tolist()
        unknown = known.unknown_length(points)
        looks = max(unknown / (speed * self._plan_time), 1.0) if unknown else 0.0
        ahead, behind = (2.0 * looks * turn / turn_rate for turn in known.blind_turns)
        return ahead, behind

    def _look(self) -> None:
        """Bring the search on the tangent graph to the end of a part."""
        tangents = self._tangents
        assert tangents is not None
        while True:
            path = tangents.advance()
            if path is not None and self._takes(path):
                return
            if tangents.part is Part.NOTHING:
                self._gave_up = self._gave_up or tangents.gave_up
                self._try_next_clearance()
                return
            if tangents.part is not Part.NEXT:
                return

    def _takes(self, path: GeometricPath) -> bool:
        """Compare a path that was found; whether no later one of its clearance can be cheaper."""
        request, o, obstacles = self._request, self._options, self._obstacles
        assert obstacles is not None
        time, driven = path.time * self._narrowness(self._clearance), request.driven
        if time >= self._price:
            self._try_next_clearance()
            return True
        to_switch = 0.0
        if driven is not None:
            to_switch = max(o.switch_time, request.gear_time) + o.switch_share * path.time
        is_like = driven is not None and same_side(driven, path, obstacles.landmarks)
        lost = sum(
            route.lost
            for route in request.tried
            if abs(route.clearance - self._clearance) <= o.cut_depth
            and same_side(route, path, obstacles.landmarks)
        )
        price = time + lost + (0.0 if is_like else to_switch) + self._extras(path)
        if price < self._price:
            poses = poses_along(path, request.start, request.goal)
            self._best = Path(poses, None, self._clearance, not is_like)
            self._price = price
        self._keeps_side = self._keeps_side or is_like
        if self._price <= time + (to_switch if self._keeps_side else 0.0):
            self._try_next_clearance()
            return True
        return False

    def _extras(self, path: GeometricPath) -> float:
        """What a path costs beside its time and that of switching to it [s]."""
        request, o = self._request, self._options
        extra = 0.0
        if self._body is not None and not self._body.fits(path, request):
            extra += o.unfit_cost
        if request.driven is not None and request.driven.reverse != path.reverse:
            extra += request.gear_time
        heading = float(path.headings[0]) + (math.pi if path.reverse else 0.0)
        if request.turned * wrap(heading - float(request.start[2])) < 0.0:
            extra += abs(request.turned) / float(request.forward[1])
        if request.known is not None:
            unknown = request.known.unknown_length(path.points)
            extra += o.unknown_cost * unknown / float(request.forward[0])
        return extra

    def _narrowness(self, clearance: float) -> float:
        """How many times its time a path counts that keeps a clearance [m]."""
        return 1.0 + self._options.narrow_cost * (1.0 - clearance / self._widest)

    @property
    def _is_cheapest(self) -> bool:
        """Whether no path of the next clearance can be cheaper: nothing is quicker than straight.

        While a robot gets on, paths that keep less than the one driven are not looked for.
        """
        request, driven = self._request, self._request.driven
        if self._best is None:
            return False
        if driven is not None and not request.tried and self._clearance <= driven.clearance:
            return True
        away = math.dist(request.start[:2], request.goal[:2]) / float(request.forward[0])
        return self._price <= away * self._narrowness(self._clearances[0])

    def _choose(self) -> None:
        """End a search; what it was made of is not needed any more."""
        self._stage, self._tangents, self._lattice_path = Stage.CHOSEN, None, None
        none = TOO_MANY if self._gave_up else NO_WAY
        self._found = none if self._best is None else self._best


def _body_paths(problem: NavigationProblem, options: GuidanceOptions) -> BodyPaths | None:
    """What looks whether a robot that is not round fits on a path."""
    if problem.footprint is None:
        return None
    # here, since most robots are round
    from kmpc_lite.control.path.body_paths import BodyPaths

    return BodyPaths(problem, problem.footprint, options)


def same_side(route: Route, path: GeometricPath, landmarks: Array) -> bool:
    """Tell whether two paths to one goal pass every obstacle on the same side, in the same gear.

    Parameters
    ----------
    route : Route
        One of them.
    path : GeometricPath
        The other one.
    landmarks : ndarray
        A point in each obstacle, (L, 2) [m].
    """
    if route.reverse != path.reverse:
        return False
    turned = angle_swept(route.points, landmarks) - angle_swept(path.points, landmarks)
    return bool((np.abs(turned) < np.pi).all())
