"""The planner that is used unless there is another one: tangent graphs, and a lattice for grids.

For each clearance, the widest first, paths are looked for on the tangent graph, and on the lattice
before it where the map has one. The cheapest path is taken: what it costs is its time, longer where
it is narrow or unknown, what it takes to switch to it, and the time that was lost on it before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.clearance import VELOCITY
from kmpc_lite.control.options import (
    GuidanceOptions,
    lengths_from_radii,
    unit_length,
)

# here, for no step has time to import its image filters
from kmpc_lite.control.path.lattice import Fineness, Lattice, LatticeTask
from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.planner import Path, PathRequest
from kmpc_lite.control.path.price import (
    extra_time,
    fits,
    look_times,
    lost_time,
    narrowness,
    same_side,
    switching_time,
)
from kmpc_lite.control.path.surroundings import (
    Obstacles,
    all_clearances,
    gather,
    led_out,
    way_out,
)
from kmpc_lite.control.path.tangent_graph import GeometricPath, PathQuery
from kmpc_lite.control.path.tangent_search import tangent_paths
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.solids import same_solids

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids

UNFIT_COST = 1000.0
"""What a path costs on which a robot that is not round does not fit: it is driven if there is no
other [s]."""

NO_WAY = "no passage to the goal is wide enough"
TOO_MANY = "too many obstacles are in the way to find a path around them"


LATTICE_RECTANGLES = 24
"""Occupancy grids with up to so many rectangles give the tangent graph all of their corners; of
larger ones the lattice picks some."""
SEEN_STEP = 0.5
"""Least distance between neighbours of the lattice among what scans show [radii]."""
SEEN_NODES = 12_000
"""Most nodes of that lattice: a search is a matter of milliseconds."""


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
        self._lattice: Lattice | None = None
        """Of the last search that had one."""

    def begin(self, request: PathRequest) -> None:
        """Begin a search."""
        self._start, self._out = request.start, way_out(request) if self._is_round else None
        if self._out is not None:
            request = replace(request, start=self._out)
        self._request = request
        self._clearance = math.inf
        """That is tried [m] ..."""
        self._widest = 0.0
        """... and the largest that is [m]."""
        self._best: Path | None = None
        """The cheapest path so far ..."""
        self._price = math.inf
        """... and its price [s]."""
        self._keeps_side = False
        """Whether one was found that passes all obstacles as the one driven does."""
        self._found: Path | str | None = None
        self._work = self._search()
        self._quanta = next(self._work)
        """Of the part that comes next."""

    def _lattice_of(self, request: PathRequest, solids: Solids) -> Lattice:
        """Give the lattice of solids: that of the last search, where it was made for the same."""
        kept = self._lattice
        if request.known is not None:
            # only start and goal may lie outside
            ends = np.stack([request.start[:2], request.goal[:2]])
            low, high = request.area
            limits = np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))
            return Lattice(solids, limits, self._coarse)
        return kept if kept is not None and same_solids(solids, kept.solids) else Lattice(solids)

    def path(self) -> Path | str | None:
        """What was found."""
        return self._found

    def advance(self, quanta: int) -> int:
        """Search on."""
        done = 0
        while done < quanta and self._found is None:
            done += self._quanta
            self._quanta = next(self._work, 0)
        return done

    def _search(self) -> Iterator[int]:
        """Search; how many quanta the next part of the work takes comes before each."""
        request, lattice, long = self._request, None, 1
        solids, known = request.solids, request.known
        if solids is not None and solids.rectangle_count > LATTICE_RECTANGLES:
            yield (long := self._options.hurried_parts)
            lattice = self._lattice = self._lattice_of(request, solids)
        yield long
        obstacles, gave_up = gather(request, lattice), False
        self._landmarks = obstacles.landmarks
        still = request.circles[~request.circles[:, VELOCITY].any(axis=1)]
        clearances = all_clearances(request, self._turning, self._options)
        if solids is not None and known is not None and known.coarseness:
            # cells stand out of what was hit in them, on either side by half of that in the
            # mean: from nearer the robot sees whether it fits
            clearances.append(clearances[-1] - 0.5 * known.coarseness)
        self._widest = clearances[0]
        for clearance in clearances:
            if self._is_cheapest(clearance):
                break
            self._clearance, self._keeps_side, lattice_path = clearance, False, None
            if lattice is not None:
                kept = self._inflation + clearance
                task = LatticeTask(request.start, request.goal, kept, still, obstacles.area)
                lattice_path = yield from lattice.search(task, long)
                if lattice_path is None:
                    continue
            query = self._query(obstacles, lattice_path)
            gave_up |= yield from tangent_paths(query, self._takes)
        path = self._best
        if path is None:
            self._found = TOO_MANY if gave_up else NO_WAY
        else:
            self._found = path if self._out is None else led_out(path, self._start)

    def _query(self, obstacles: Obstacles, lattice_path: LatticePath | None) -> PathQuery:
        """What is looked for on the tangent graph."""
        request = self._request
        inflated = obstacles.sizes + self._inflation + self._clearance
        return PathQuery(
            request.start,
            request.goal,
            obstacles.centres,
            np.clip(inflated, 0.0, obstacles.most),
            obstacles.edges,
            obstacles.area,
            request.forward,
            request.backward_share,
            lattice_path,
            look_times(request, lattice_path, self._plan_time),
            not self._is_round,
        )

    def _takes(self, path: GeometricPath) -> bool:
        """Compare a path that was found; whether no later one of its clearance can be cheaper."""
        request, o, landmarks = self._request, self._options, self._landmarks
        time = path.time * narrowness(self._clearance, self._widest, o)
        if time >= self._price:
            return True
        driven = request.driven
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
        return self._price <= time + (to_switch if self._keeps_side else 0.0)

    def _is_cheapest(self, clearance: float) -> bool:
        """Whether no path of a clearance [m] can be cheaper: nothing is quicker than straight.

        While a robot gets on, paths that keep less than the one driven are not looked for.
        """
        request, driven = self._request, self._request.driven
        if self._best is None:
            return False
        if driven is not None and not request.tried and self._clearance <= driven.clearance:
            return True
        away = math.dist(request.start[:2], request.goal[:2]) / float(request.forward[0])
        return self._price <= away * narrowness(clearance, self._widest, self._options)
