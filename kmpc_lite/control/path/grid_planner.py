"""The planner of robots that turn on the spot: a grid tells the sides, a taut string the rest.

For each clearance, the widest first, shortest ways to the goal are looked for on a grid, and
strings pulled taut along them. The cheapest path is taken: what it costs is its time, longer where
it is narrow or unknown, what it takes to switch to it, and the time that was lost on it before.

A round robot deep in an obstacle's margin is led straight out first. A search takes the obstacle
for as small as lets the robot be outside; deep in the margin its path would lead along the
obstacle, where hardly any motion is safe.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from heapq import heapify, heappop, heappush
from operator import attrgetter

import numpy as np

from kmpc_lite.control.options import GuidanceOptions, unit_length
from kmpc_lite.control.path.capabilities import swing
from kmpc_lite.control.path.distance_grid import DistanceGrid, Extent, MapFields, Ways
from kmpc_lite.control.path.planner import ROUNDING, Path, PathRequest, Route, poses_along
from kmpc_lite.control.path.taut_string import (
    CUT_DEPTH,
    GeometricPath,
    Line,
    Surroundings,
    TautStrings,
)
from kmpc_lite.control.path.ways import outline_distances
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import angle_swept, wrap
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

UNFIT_COST = 1000.0
"""What a path costs on which a robot that is not round does not fit: it is driven if there is no
other [s]."""
NO_WAY = "no passage to the goal is wide enough"
STEP = 0.5  # least distance between neighbours of the grid [radii]
AROUND = 33.0
"""A way around is looked for first among what lies this far about start and goal, beside their
distance [radii]."""
DIRECTIONS = 16  # directions from the start in which ways are looked for ...
RING = 0.5  # ... that lead so far from it [m], if the goal is not nearer.
APART = 3  # how many of these directions two of them lie apart at the least
CHOICE = 3  # most ways of one clearance that are compared
BODY_SAMPLES = 400
"""Largest number of poses of a path at which it is looked first whether a robot that is not round
fits."""
HALVINGS = 4  # how often it is looked between two poses that are too far apart to be sure
DEEP = 0.015  # a robot that is so deep in a margin is led out first [m] ...
OUTSIDE = 0.03  # ... to where it keeps so much more than the margin [m]: there it turns.
OUTWARDS = 64  # directions in which a way out is looked for ...
FARTHER = np.array([1.0, 1.25, 1.5, 1.75])  # ... and lengths, as multiples of what is missing.
LED_OUT = np.array([w for k in range(1, 9) for w in (0.5 * k, -0.5 * k)])
"""How far a robot that is not round is led straight out [radii of its circles]."""
OUTWARD_SHARE = 0.55
"""Least share of the way that leads away from what is near: a motion that leads away by less than
half of it is not safe."""
LEAST_CLEARANCE = 0.005
"""Clearance that is tried last: a path that keeps less would not be driven [m]."""


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
        self._clearance = math.inf  # that is tried [m] ...
        self._widest = 0.0  # ... and the largest that is [m].
        self._best: Path | None = None  # the cheapest path so far ...
        self._price = math.inf  # ... and its price [s].
        self._gets_on = False  # whether the path driven is free, as far as was looked
        self._found: Path | str | None = None
        self._work = self._search()
        self._quanta = next(self._work)  # of the part that comes next

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
            extent = Extent(step, around)
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
        self._found = path = self._best or NO_WAY
        if self._out is not None and isinstance(path, Path):
            poses, start = path.poses.copy(), self._start
            poses[:, 2] += start[2] + wrap(float(poses[0, 2] - start[2])) - poses[0, 2]
            turned = np.array([start[0], start[1], poses[0, 2]])
            self._found = replace(path, poses=np.concatenate([start[None], turned[None], poses]))

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
            for reverse, share in enumerate((1.0, request.backward[0] / request.forward[0])):
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
            line = np.concatenate([ends[0], request.driven.points[1:-1], ends[1]])
            self._gets_on = bool(grid.lines_free(line[:-1], line[1:], around.least).all())
            lines = [line] * self._gets_on
        times = np.full(DIRECTIONS, math.inf)
        nodes, begin = list(map(grid.node, away)), np.repeat(ends[0], DIRECTIONS, axis=0)
        # once time was lost, no nearer than it stands, as the grid sees that
        here = float(grid.distances(ends[0])[0]) if request.tried else math.inf
        clear = grid.holds(away) & grid.lines_free(begin, away, min(around.least, here))
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
        if driven is not None and not is_like:
            price += max(o.switch_time, request.gear_time) + o.switch_share * path.time
        price += lost_time(path, self._clearance, request, points)
        price += extra_time(path, request, o)
        if price >= self._price:
            return
        poses = plain = poses_along(path, request.start, request.goal)
        if not self._is_round:
            poses = turned_where_free(plain, request, self._margin)
            price += 0.0 if fits(poses, request, self._margin) else UNFIT_COST
        if price < self._price:
            self._best = Path(poses, None, self._clearance, not is_like, led=poses is not plain)
            self._price = price

    def _is_cheapest(self, clearance: float) -> bool:
        """Whether no path of a clearance [m] can be cheaper: nothing is quicker than straight.

        While a robot gets on, and the path driven is free, none that keeps less is looked for.
        """
        request, driven = self._request, self._request.driven
        if self._best is None:
            return False
        if driven and self._gets_on and not request.tried and self._clearance <= driven.clearance:
            return True
        away = math.dist(request.start[:2], request.goal[:2]) / float(request.forward[0])
        return self._price <= away * narrowness(clearance, self._widest, self._options)


def narrowness(clearance: float, widest: float, options: GuidanceOptions) -> float:
    """How many times its time a path counts that keeps a clearance, of the widest one [m]."""
    return 1.0 + options.narrow_cost * (1.0 - clearance / widest)


def lost_time(
    path: GeometricPath, clearance: float, request: PathRequest, landmarks: Array
) -> float:
    """Time that was lost on paths like this one [s]."""
    return sum(
        route.lost
        for route in request.tried
        if abs(route.clearance - clearance) <= CUT_DEPTH and same_side(route, path, landmarks)
    )


def extra_time(path: GeometricPath, request: PathRequest, options: GuidanceOptions) -> float:
    """What a change of gear, turning back, and the unknown cost [s]."""
    extra = 0.0
    if request.driven is not None and request.driven.reverse != path.reverse:
        extra += request.gear_time
    heading = float(path.headings[0]) + (math.pi if path.reverse else 0.0)
    if request.turned * wrap(heading - float(request.start[2])) < 0.0:
        extra += abs(request.turned) / float(request.forward[1])
    if request.known is not None:
        unknown = request.known.unknown_length(path.points)
        extra += options.unknown_cost * unknown / float(request.forward[0])
    return extra


def look_times(request: PathRequest, points: Array, plan_time: float) -> tuple[float, float]:
    """How long the robot stops on its way to look, driving forwards, and backwards [s].

    If no scanner looks in the direction in which it drives, it turns round to look, and back,
    each time it has come to the end of what it saw: that is as far as plans lead.
    """
    known = request.known
    if known is None or not any(known.blind_turns):
        return 0.0, 0.0
    speed, turn_rate = request.forward.tolist()
    unknown = known.unknown_length(points)
    looks = max(unknown / (speed * plan_time), 1.0) if unknown else 0.0
    ahead, behind = (2.0 * looks * turn / turn_rate for turn in known.blind_turns)
    return ahead, behind


def turned_where_free(poses: Array, request: PathRequest, margin: float) -> Array:
    """Poses (K, 3) of a path, led straight ahead or back first if what sticks out has no room.

    It turns where `margin` [m], and what its motions need, is free beside it, or most of that is.
    """
    (start, turned, corner), rest = poses[:3], poses[2:]
    along = np.linspace(0.0, 1.0, 16)[:, None]  # where each part of the way is looked at
    room = float(outline_distances(request, start + along * (turned - start)).min()) - margin
    if room >= DEEP:
        return poses
    least = min(margin, float(outline_distances(request, start[None])[0])) - CUT_DEPTH
    ahead = np.array((math.cos(start[2]), math.sin(start[2]), 0.0))
    gear = 1.0 if (corner - start)[:2] @ (math.cos(turned[2]), math.sin(turned[2])) > 0.0 else -1.0
    for way in LED_OUT * float(request.outline[0, 2]):
        # it turns as soon as it has come half of the way
        out, half = start + way * ahead, start + 0.5 * way * ahead
        outside = (np.clip(out[:2], *request.area) != out[:2]).any()
        if room >= OUTSIDE or outside or (way < 0.0 and not request.backward[0] > 0.0):
            continue
        x, y = gear * (corner - out)[:2]
        turn = np.array((0.0, 0.0, wrap(math.atan2(y, x) - start[2])))
        line = out + turn, np.array((*corner[:2], start[2] + turn[2]))
        driven = np.concatenate([a + along * (b - a) for a, b in ((start, out), line)])
        turns = np.concatenate([here + along * turn for here in (half, out)])
        found = float(outline_distances(request, turns).min()) - margin
        if found > room and outline_distances(request, driven).min() >= least:
            room, poses = found, np.concatenate([np.stack([start, out, out + turn]), rest])
    return poses


def fits(corners: Array, request: PathRequest, margin: float) -> bool:
    """Whether all circles of a robot keep a margin [m] along a path's poses (K, 3).

    Where it begins and ends, and turns on the spot, too.
    """
    radius = float(request.outline[0, 2])
    reach = float(np.hypot(*request.outline[:, :2].T).max())
    steps = np.diff(corners, axis=0)
    moved = np.hypot(steps[:, 0], steps[:, 1]) + reach * np.abs(steps[:, 2])
    places = np.concatenate([[0.0], np.cumsum(moved)])
    count = min(2 + math.ceil(places[-1] / (0.5 * radius)), BODY_SAMPLES)
    along = np.linspace(0.0, places[-1], count)

    def distances_at(along: Array) -> Array:
        poses = np.stack([np.interp(along, places, column) for column in corners.T], axis=1)
        return outline_distances(request, poses)

    distances = distances_at(along)
    # where it stands now, and where it is to stand, it may be as near as it is
    needed = min(margin, float(distances[0]), float(distances[-1])) - CUT_DEPTH
    for _ in range(HALVINGS):
        unsure = distances[:-1] + distances[1:] - np.diff(along) < 2.0 * needed
        if not unsure.any() or (distances < needed).any():
            break
        after, between = np.flatnonzero(unsure) + 1, 0.5 * (along[:-1] + along[1:])[unsure]
        along = np.insert(along, after, between)
        distances = np.insert(distances, after, distances_at(between))
    return bool((distances >= needed).all())


def same_side(route: Route, path: GeometricPath, landmarks: Array) -> bool:
    """Tell whether two paths to one goal pass every obstacle on the same side, in the same gear.

    `route`: one of them. `path`: the other one. `landmarks`: a point in each obstacle, (L, 2) [m].
    """
    if route.reverse != path.reverse:
        return False
    turned = angle_swept(route.points, landmarks) - angle_swept(path.points, landmarks)
    return bool((np.abs(turned) < np.pi).all())


def way_out(request: PathRequest) -> Array | None:
    """Pose (3,) to which a round robot deep in a margin drives first; None if it is not.

    It lies straight ahead or behind once it has turned. After lost time touching nearly counts.
    """
    start, needed = request.start, request.inflation + OUTSIDE
    around = float(request.distances(start[None, :2])[0])
    if request.inflation - around <= (-LEAST_CLEARANCE if request.tried else DEEP):
        return None
    courses = start[2] + math.tau / OUTWARDS * np.arange(OUTWARDS)
    lengths = (FARTHER * (needed - around))[:, None]
    away = lengths[..., None] * np.stack([np.cos(courses), np.sin(courses)], axis=1)
    ends, middles = start[:2] + away, start[:2] + 0.5 * away
    clear = ((ends >= request.area[0]) & (ends <= request.area[1])).all(axis=2)
    shape = clear.shape
    reached = request.distances(ends.reshape(-1, 2)).reshape(shape)
    between = request.distances(middles.reshape(-1, 2)).reshape(shape)
    clear &= (reached >= needed - ROUNDING) & (reached >= around + OUTWARD_SHARE * lengths)
    clear &= between > around
    if not clear.any():
        return None
    ahead = np.abs(wrap(courses - start[2]))
    behind = np.full(len(ahead), np.inf)
    if request.backward[0] > 0.0:
        behind = math.pi - ahead
    times = np.minimum(ahead, behind) / request.forward[1] + lengths / request.forward[0]
    length, best = divmod(int(np.where(clear, times, np.inf).argmin()), OUTWARDS)
    turned = math.pi if behind[best] < ahead[best] else 0.0
    return np.array([*ends[length, best], courses[best] + turned])


def all_clearances(request: PathRequest, turning: float, options: GuidanceOptions) -> list[float]:
    """Clearances that are tried [m], the widest first.

    `request`: has the clearance at full speed, and the turning centre. `turning`: what the robot
    needs beyond half its width to turn on the spot [m]; a round one nothing. `options`: in metres.
    """
    widest, centre = options.wide_clearance, request.centre
    narrow = [options.narrow_clearance, LEAST_CLEARANCE]
    clearances = [widest, *narrow]
    if request.clearance > widest:
        clearances = [request.clearance, *clearances]
    beside = 0.0 if centre is None else abs(float(centre[1]))
    if turning:
        # first where it may turn anywhere, then where it just fits through
        wider = [c + turning + swing(centre) for c in clearances]
        return wider + [c + beside for c in (widest, *narrow)]
    if centre is None:
        return clearances
    # the pose swings around the turning centre: where that is too wide, only as far as it lies
    # beside it
    around = swing(centre)
    return [c + around for c in clearances] + [c + beside for c in narrow]
