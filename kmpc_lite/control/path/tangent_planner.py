"""The planner that is used unless there is another one: tangent graphs, and a lattice for grids.

For each clearance, the widest first, paths are looked for on the tangent graph, and on the lattice
before it where the map has one. The cheapest path is taken: what it costs is its time, longer where
it is narrow or unknown, what it takes to switch to it, and the time that was lost on it before.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto

import numpy as np

from kmpc_lite.control.kernels.clearance import VELOCITY
from kmpc_lite.control.options import (
    GuidanceOptions,
    lengths_from_radii,
    unit_length,
)
from kmpc_lite.control.path.lattice import Fineness, LatticeTask
from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.planner import Path, PathRequest, same_solids
from kmpc_lite.control.path.price import (
    extra_time,
    fits,
    look_times,
    lost_time,
    narrowness,
    same_side,
    switching_time,
)
from kmpc_lite.control.path.search_obstacles import (
    Obstacles,
    PathMap,
    all_clearances,
    gather,
)
from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import Part, TangentSearch
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.path.way_out import led_out, way_out
from kmpc_lite.control.problem import NavigationProblem

UNFIT_COST = 1000.0
"""What a path costs on which a robot that is not round does not fit: it is driven if there is no
other [s]."""

NO_WAY = "no passage to the goal is wide enough"
TOO_MANY = "too many obstacles are in the way to find a path around them"


class Stage(Enum):
    """What the next part of a search is."""

    MAP = auto()
    """Make the lattice, unless it was made for the last search: this search has as many parts."""
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


SEEN_STEP = 0.5
"""Least distance between neighbours of the lattice among what scans show [radii]."""
SEEN_NODES = 12_000
"""Most nodes of that lattice: a search is a matter of milliseconds."""
ON_LATTICE = Stage.MAP, Stage.OBSTACLES, Stage.LINKED, Stage.STRAIGHTEN
"""Where a search on a lattice does the most work."""


class TangentPlanner:
    """Looks for paths, part by part.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, horizon; in the robot's units.
    options : GuidanceOptions
        Lengths in radii.
    """

    def __init__(self, problem: NavigationProblem, options: GuidanceOptions) -> None:
        unit = unit_length(problem)
        self._options = lengths_from_radii(options, unit)
        self._coarse = Fineness(SEEN_STEP * unit, SEEN_NODES)
        self._inflation = problem.inflation
        self._turning = problem.robot_radius - problem.half_width
        """What the robot needs beyond that to turn on the spot [m]; a round one nothing."""
        self._is_round, self._margin = problem.footprint is None, problem.margin
        self._plan_time = problem.horizon * problem.dt
        self._map: PathMap | None = None

    def begin(self, request: PathRequest) -> None:
        """Begin a search."""
        self._start, self._out = request.start, way_out(request) if self._is_round else None
        if self._out is not None:
            request = replace(request, start=self._out)
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
        if self._map is not None and self._map.has_lattice:
            self._stage = Stage.MAP

    def _map_of(self, request: PathRequest) -> PathMap | None:
        """The solids, prepared: as they were for the last search, where they are the same."""
        solids, known = request.solids, request.known
        if solids is None:
            return None
        limits = request.area[0], request.area[1]
        if known is not None:
            return PathMap(solids, known.coarseness, limits, self._coarse)
        if self._map is not None and same_solids(solids, self._map.solids):
            return self._map
        return PathMap(solids)

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
        if self._map is not None and self._map.has_lattice and self._stage in ON_LATTICE:
            return self._options.hurried_parts
        if self._stage is Stage.TANGENTS and self._tangents is not None:
            return self._tangents.weight
        return 1

    def _do_part(self) -> None:
        """Do one part of the work."""
        request, path_map = self._request, self._map
        if self._stage is Stage.MAP and path_map is not None:
            path_map.prepare(request.start, request.goal)
            self._stage = Stage.OBSTACLES
        elif self._stage is Stage.OBSTACLES:
            self._obstacles = gather(request, path_map)
            clearances = all_clearances(request, self._turning, self._options)
            if path_map is not None and path_map.coarseness:
                # cells stand out of what was hit in them, on either side by half of that in the
                # mean: from nearer the robot sees whether it fits
                clearances.append(clearances[-1] - 0.5 * path_map.coarseness)
            self._clearances, self._widest = clearances, clearances[0]
            self._try_next_clearance()
        elif self._stage is Stage.LINKED and path_map is not None and path_map.lattice is not None:
            path_map.lattice.find(self._on_lattice)
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

    def _try_next_clearance(self) -> None:
        """Begin with the next clearance, unless none is left or a path is quick enough."""
        if not self._clearances or self._is_cheapest:
            self._choose()
            return
        self._clearance, self._keeps_side = self._clearances.pop(0), False
        path_map = self._map
        if path_map is not None and path_map.lattice is not None:
            path_map.lattice.link(self._on_lattice)
            self._stage = Stage.LINKED
            return
        self._begin_graph()
        self._look()

    @property
    def _on_lattice(self) -> LatticeTask:
        """Between what, and how far from what, a path on the lattice is looked for."""
        assert self._obstacles is not None
        request, inflation = self._request, self._inflation + self._clearance
        still = request.circles[~request.circles[:, VELOCITY].any(axis=1)]
        return LatticeTask(request.start, request.goal, inflation, still, self._obstacles.area)

    def _straighten(self) -> None:
        """Pull the lattice's path straight, if there is one."""
        assert self._map is not None and self._map.lattice is not None
        self._lattice_path = self._map.lattice.path(self._on_lattice)
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
            look_times(request, self._lattice_path, self._plan_time),
        )
        self._tangents = TangentSearch(query)
        self._stage = Stage.TANGENTS

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
        time = path.time * narrowness(self._clearance, self._widest, o)
        if time >= self._price:
            self._try_next_clearance()
            return True
        driven, landmarks = request.driven, obstacles.landmarks
        to_switch = switching_time(path, request, o)
        is_like = driven is not None and same_side(driven, path, landmarks)
        lost = lost_time(path, self._clearance, request, landmarks)
        unfit = 0.0 if self._is_round or fits(path, request, self._margin) else UNFIT_COST
        price = time + lost + (0.0 if is_like else to_switch)
        price += unfit + extra_time(path, request, o)
        if price < self._price:
            poses = poses_along(path, request.start, request.goal)
            self._best = Path(poses, None, self._clearance, not is_like)
            self._price = price
        self._keeps_side = self._keeps_side or is_like
        if self._price <= time + (to_switch if self._keeps_side else 0.0):
            self._try_next_clearance()
            return True
        return False

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
        return self._price <= away * narrowness(self._clearances[0], self._widest, self._options)

    def _choose(self) -> None:
        """End a search; what it was made of is not needed any more."""
        self._stage, self._tangents, self._lattice_path = Stage.CHOSEN, None, None
        path = self._best
        if path is None:
            self._found = TOO_MANY if self._gave_up else NO_WAY
        else:
            self._found = path if self._out is None else led_out(path, self._start)
