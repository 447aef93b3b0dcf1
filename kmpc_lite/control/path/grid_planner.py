"""The planner of robots that turn on the spot: a grid tells the sides, a taut string the rest.

For each clearance, the widest first, shortest ways to the goal are looked for on a grid, and
strings pulled taut along them. The cheapest path is taken: what it costs is its time, longer where
it is narrow or unknown, what it takes to switch to it, and the time that was lost on it before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from heapq import heapify, heappop, heappush
from operator import attrgetter

import numpy as np

from kmpc_lite.control.options import GuidanceOptions, lengths_from_radii, unit_length

# here, for no step has time to import its image filters
from kmpc_lite.control.path.distance_grid import DistanceGrid, Extent, MapFields, Ways
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
from kmpc_lite.control.path.surroundings import all_clearances, led_out, way_out
from kmpc_lite.control.path.taut_string import GeometricPath, Line, Surroundings, TautStrings
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

UNFIT_COST = 1000.0
"""What a path costs on which a robot that is not round does not fit: it is driven if there is no
other [s]."""
NO_WAY = "no passage to the goal is wide enough"
STEP = 0.5
"""Least distance between neighbours of the grid [radii]."""
NODES = 40_000
"""Most nodes of the grid: what memory and a few steps of searching allow, ..."""
SEEN_NODES = 12_000
"""... and among what scans show, which is looked at anew all the time."""
AROUND = 33.0
"""A way around is looked for first among what lies this far about start and goal, beside their
distance [radii]."""
DIRECTIONS = 16
"""Directions from the start in which ways are looked for ..."""
RING = 0.5
"""... that lead so far from it [m], if the goal is not nearer."""
APART = 3
"""How many of these directions two of them lie apart at the least."""
CHOICE = 3
"""Most ways of one clearance that are compared."""


class GridPlanner:
    """Looks for paths, part by part.

    `problem`: radius, margin, horizon; in the robot's units. `options`: lengths in radii.
    """

    def __init__(self, problem: NavigationProblem, options: GuidanceOptions) -> None:
        unit = unit_length(problem)
        self._options = lengths_from_radii(options, unit)
        self._unit = unit
        self._inflation = problem.inflation
        self._turning = problem.robot_radius - problem.half_width
        """What the robot needs beyond that to turn on the spot [m]; a round one nothing."""
        self._is_round, self._margin = problem.footprint is None, problem.margin
        self._plan_time = problem.horizon * problem.dt
        self._maps = MapFields()

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
        self._found: Path | str | None = None
        self._work = self._search()
        self._quanta = next(self._work)
        """Of the part that comes next."""

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
        request, known = self._request, self._request.known
        step = STEP * self._unit
        yield 1
        fields = self._maps.of(request.solids, step)
        within = [] if request.solids is None else [request.solids.landmarks]
        within += map(attrgetter("landmarks"), fields)
        self._landmarks = np.concatenate([request.circles[:, :2], *within])
        clearances = all_clearances(request, self._turning, self._options)
        if known is not None and known.coarseness:
            # cells stand out of what was hit in them, on either side by half of that in the
            # mean: from nearer the robot sees whether it fits
            clearances.append(clearances[-1] - 0.5 * known.coarseness)
        self._widest = clearances[0]
        near = math.dist(request.start[:2], request.goal[:2]) + AROUND * self._unit
        for around in (near, math.inf):
            yield 3
            extent = Extent(step, NODES if known is None else SEEN_NODES, around)
            grid = DistanceGrid(request, extent, fields)
            yield from grid.see()
            for clearance in clearances:
                if self._is_cheapest(clearance):
                    break
                self._clearance = clearance
                yield 3
                yield from self._try(grid, self._inflation + clearance)
            if self._best is not None or grid.is_whole:
                break
        path = self._best
        if path is None:
            self._found = NO_WAY
        else:
            self._found = path if self._out is None else led_out(path, self._start)

    def _try(self, grid: DistanceGrid, kept: float) -> Iterator[int]:
        """Look for paths that keep a distance [m]."""
        request = self._request
        goal, start = grid.node(request.goal), grid.node(request.start)
        free, places = grid.free(kept)
        ways = Ways(free, grid.costs(kept), grid.step, goal)
        if not math.isfinite(ways.cost[start]):
            return
        around = Surroundings(request, grid, kept)
        open_strings = list[tuple[float, int, TautStrings, float, float]]()
        known = list[list[list[float]]]()
        for line in self._lines(grid, ways, places, around):
            yield 1
            corners = around.pulled(line)
            if corners.tolist() in known:
                continue
            known.append(corners.tolist())
            pulled = Line(corners, [around.contact(point, corners) for point in corners[1:-1]])
            looks = look_times(request, corners, self._plan_time)
            for reverse, share in enumerate((1.0, request.backward_share)):
                if share > 0.0:
                    found = TautStrings(request, around, pulled, bool(reverse))
                    number = 2 * len(known) + reverse
                    time = found.time / share + looks[reverse]
                    open_strings.append((time, number, found, share, looks[reverse]))
        heapify(open_strings)
        narrow = narrowness(self._clearance, self._widest, self._options)
        while open_strings and open_strings[0][0] * narrow < self._price:
            yield 1
            time, number, found, share, look = heappop(open_strings)
            around.quanta = 0
            path = found.freed()
            if around.quanta:
                yield around.quanta  # what is over already counts all the same
            if path is not None:
                self._takes(replace(path, time=time))
            else:
                again = found.time / share + look
                heappush(open_strings, (again, number, found, share, look))

    def _lines(
        self, grid: DistanceGrid, ways: Ways, places: Array, around: Surroundings
    ) -> list[Array]:
        """Lines (n, 2) from start to goal: the path driven, and the quickest in some directions."""
        request, start, goal = self._request, self._request.start, self._request.goal
        apart = math.dist(start[:2], goal[:2])
        reach = min(RING, 0.5 * apart)
        courses = start[2] + math.tau / DIRECTIONS * np.arange(DIRECTIONS)
        away = start[:2] + reach * np.stack([np.cos(courses), np.sin(courses)], axis=1)
        ends = [start[None, :2], goal[None, :2]]
        lines: list[Array] = []
        if request.driven is not None:
            lines.append(np.concatenate([ends[0], request.driven.points[1:-1], ends[1]]))
            steps = lines[0][:-1], lines[0][1:]
            if not grid.lines_free(*steps, around.least).all():
                lines.clear()
        times = np.full(DIRECTIONS, math.inf)
        nodes, begin = list(map(grid.node, away)), np.repeat(ends[0], DIRECTIONS, axis=0)
        clear = grid.holds(away) & grid.lines_free(begin, away, around.least)
        speed, turn_rate = request.forward.tolist()
        for i, node in enumerate(nodes):
            if clear[i]:
                turn = abs(float(wrap(courses[i] - start[2])))
                turn = min(turn, math.pi - turn) if request.backward[0] > 0.0 else turn
                times[i] = ways.cost[node] / speed + turn / turn_rate
        begins = list[int]()
        while len(begins) < CHOICE and math.isfinite(times.min()):
            best = int(times.argmin())
            begins.append(nodes[best])
            near = (np.arange(DIRECTIONS) - best + APART - 1) % DIRECTIONS < 2 * APART - 1
            times[near] = math.inf
        for node in begins or [grid.node(start)]:
            way = places[ways.line_from(node)[:-1]]
            lines.append(np.concatenate([ends[0], way, ends[1]]))
        return lines

    def _takes(self, path: GeometricPath) -> None:
        """Compare a path that was found with the cheapest so far."""
        request, o, points = self._request, self._options, self._landmarks
        price = path.time * narrowness(self._clearance, self._widest, o)
        if price >= self._price:
            return
        driven = request.driven
        is_like = driven is not None and same_side(driven, path, points)
        if not is_like:
            price += switching_time(path, request, o)
        price += lost_time(path, self._clearance, request, points)
        price += extra_time(path, request, o)
        if price < self._price and not (self._is_round or fits(path, request, self._margin)):
            price += UNFIT_COST
        if price < self._price:
            poses = poses_along(path, request.start, request.goal)
            self._best = Path(poses, None, self._clearance, not is_like)
            self._price = price

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
