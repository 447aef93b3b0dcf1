"""What the guide asks of a planner: a path from a pose to a pose, looked for bit by bit.

The guide knows nothing else of it, so that a user can hand in one of their own:
`Controller(model, problem, planner=...)`.

A `TimedPath` is a path as it is driven: how fast, and where on it the robot is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from kmpc_lite.control.kernels.records import Timed, poses_at
from kmpc_lite.geometry import nearest_turn, wrap
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.path.taut_string import GeometricPath
    from kmpc_lite.control.world.solids import Solids

NEAR_GOAL = 0.3
"""A robot nearer to its goal than this that lags more than its model knows has soon left the place
where a search began [m]."""
ROUNDING = 1e-9  # length [m], angle [rad] or time [s] that is none


class Route(NamedTuple):
    """A path that is driven, or was: what another one is compared with."""

    points: Array  # (K, 2) from the robot's place on it to the goal [m]
    reverse: bool  # whether it is driven backwards
    clearance: float  # what it keeps beyond the request's inflation [m]
    lost: float  # time lost on it since its best time to go last fell [s]

    def in_metres(self, scale: Scale) -> Route:
        """Give the same of a route in the robot's units."""
        length, lost = scale.length, self.lost * scale.time
        return Route(length * self.points, self.reverse, length * self.clearance, lost)


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What scans have shown, as a planner needs it."""

    unknown: Array  # (H, W) bool, whether nothing is known of a cell; beyond the cells nothing is
    corner: Array  # (2,) where the first cell begins [m]
    cell: float  # side of a cell [m]
    blind_turns: tuple[float, float]
    """How far the robot must turn until it sees what lies ahead, and behind [rad]."""
    coarseness: float  # how far solids may stand out of what was hit: they are cells [m]

    def unknown_length(self, points: Array) -> float:
        """How much of a line through points (n, 2) is unknown [m]."""
        steps = np.diff(points, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        length = float(lengths.sum())
        count = max(int(np.ceil(length / self.cell)), 1)
        along = np.linspace(0.0, length, count + 1)
        places = np.concatenate([[0.0], np.cumsum(lengths)])
        x, y = np.interp(along, places, points[:, 0]), np.interp(along, places, points[:, 1])
        away = np.stack((x, y), axis=1) - self.corner
        column, row = np.floor(away / self.cell).astype(np.intp).T
        height, width = self.unknown.shape
        inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        unknown = ~inside
        unknown[inside] = self.unknown[row[inside], column[inside]]
        return length * float(unknown.mean())


class Nearest(NamedTuple):
    """The circle, or the point of a solid, that is nearest to each of n points."""

    gap: Array  # (n,) distance from its edge [m]; inside below 0
    away: Array  # (n, 2) direction away from it
    centre: Array  # (n, 2) its middle [m]
    size: Array  # (n,) its radius [m]; below 0 where solids stand out of what was hit


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PathRequest:
    """Between which poses, and around what, a path is looked for: data, in metres and seconds.

    Poses are those of the point about which the robot turns on the spot: nearly always its own.
    """

    start: Array
    """Pose (3,) where the path begins [m, m, rad]."""
    goal: Array
    """Pose (3,) where it ends."""
    target: Array
    """Goal (3,) of the tracked pose."""
    centre: Array | None = None
    """(2,) where the robot turns on the spot, ahead and to the left of its tracked pose [m]; None:
    there."""
    circles: Array
    """(M, 5) rows x, y, radius, vx, vy, where the robot meets them [m, m/s]."""
    solids: Solids | None = None
    """Polygons, walls and grids, what scans have shown among them; see `distances`."""
    outline: Array
    """(C, 3) circles of the robot: x ahead, y to the left, radius [m]."""
    inflation: float
    """Half the robot's width and its margin: how near its middle may come to obstacles [m]."""
    area: Array
    """(2, 2) least and largest x, y of the robot; infinite if it is open [m]."""
    forward: Array
    """(2,) speed [m/s] and rate of turn [rad/s] ahead."""
    backward: Array
    """(2,) the same backwards; no speed where the robot may not."""
    clearance: float = 0.0
    """Clearance beyond `inflation` that full speed needs [m]."""
    known: Known | None = None
    """What scans have shown; None without scans: then everything is known."""
    driven: Route | None = None
    """The path that is driven now, and kept to where another one is hardly better."""
    tried: tuple[Route, ...] = ()
    """Paths that were driven before, and led nowhere."""
    turned: float = 0.0
    """How far the robot has turned on the spot just now [rad]: turning back costs as much."""
    gear_time: float = 0.0
    """What a change of the gear driven costs [s]."""
    curvature: float = 0.0
    """In which the wheels of a car stand [1/m] ..."""
    gear: float = 0.0
    """... and in which gear it drives: 1, -1, or 0 if it stands."""
    curving: float = 1.0
    """Share of its sharpest curvature that it drives."""
    steering_lag: float = 0.0
    """Time until its turn rate has changed by half of what was commanded [s]."""
    footprint: Footprint | None = None
    """What the circles cover; none of a round robot."""
    unit: float = 1.0
    """One unit of the solids' lengths [m]."""

    def distances(self, points: Array) -> Array:
        """Distances (n,) of points (n, 2) from the nearest circle or solid [m]; inside below 0."""
        coarse = 0.0 if self.known is None else self.known.coarseness
        return distances_around(points, self.circles, self.solids, coarse, self.unit)

    def nearest(self, points: Array) -> Nearest:
        """What is nearest to each of points (n, 2)."""
        gap, away = np.full(len(points), np.inf), np.zeros_like(points)
        centre, size = points.copy(), np.zeros(len(points))
        if len(self.circles):
            off = points[:, None] - self.circles[:, :2]
            apart = np.hypot(off[..., 0], off[..., 1])
            which = (apart - self.circles[:, 2]).argmin(axis=1)
            rows = np.arange(len(points))
            apart = apart[rows, which]
            centre, size = self.circles[which, :2], self.circles[which, 2]
            gap = apart - size
            away = off[rows, which] / np.maximum(apart, ROUNDING)[:, None]
        if self.solids is not None:
            coarse = 0.0 if self.known is None else self.known.coarseness
            distance, normal = self.solids.whole.nearest(points / self.unit)
            of_solids = distance * self.unit
            nearer = of_solids + coarse < gap
            gap[nearer], away[nearer] = of_solids[nearer] + coarse, normal[nearer]
            centre[nearer] = (points - of_solids[:, None] * normal)[nearer]
            size[nearer] = -coarse
        return Nearest(gap, away, centre, size)

    def in_metres(self, scale: Scale) -> PathRequest:
        """Give the same of a request in the robot's units."""
        length, speed = scale.length, np.array((scale.speed, 1.0 / scale.time))
        known = self.known
        if known is not None:
            known = replace(
                known,
                corner=length * known.corner,
                cell=length * known.cell,
                coarseness=length * known.coarseness,
            )
        driven = None if self.driven is None else self.driven.in_metres(scale)
        return replace(
            self,
            start=self.start * scale.state,
            goal=self.goal * scale.state,
            target=self.target * scale.state,
            centre=None if self.centre is None else length * self.centre,
            circles=self.circles * scale.circle,
            outline=length * self.outline,
            footprint=None if self.footprint is None else self.footprint.scaled(1.0 / length),
            inflation=length * self.inflation,
            area=length * self.area,
            forward=self.forward * speed,
            backward=self.backward * speed,
            clearance=length * self.clearance,
            known=known,
            driven=driven,
            tried=tuple(route.in_metres(scale) for route in self.tried),
            gear_time=self.gear_time * scale.time,
            curvature=self.curvature / length,
            steering_lag=self.steering_lag * scale.time,
            unit=length * self.unit,
        )


def distances_around(
    points: Array, circles: Array, solids: Solids | None, coarse: float = 0.0, unit: float = 1.0
) -> Array:
    """Distances (n,) of points (n, 2) from the edge of the nearest circle (M, 5) or solid [m].

    Solids stand out of what was hit by as much as they are coarse [m]; their unit is so long [m].
    """
    x, y = points.T[..., None] - circles[:, :2].T[:, None]
    distances: Array = (np.hypot(x, y) - circles[:, 2]).min(axis=1, initial=np.inf)
    if solids is not None:
        np.minimum(distances, solids.whole.least(points / unit) * unit + coarse, out=distances)
    return distances


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Poses from the start of a request to its goal."""

    poses: Array
    """(K, 3) [m, m, rad], K >= 2: between neighbours the robot drives straight, along an arc, or
    turns on the spot; headings never jump by 2 pi. A piece whose points lie behind one another is
    driven backwards."""
    times: Array | None = None
    """(K,) when they are reached, from 0 on [s]; None: as soon as the robot can."""
    clearance: float = 0.0
    """What it keeps beyond the request's inflation, start and goal aside [m]."""
    switched: bool = True
    """Whether it leads around some obstacle on another side than the path driven."""
    sideways: bool = False
    """Whether the robot may drive in any direction: then it has no gears."""
    led: bool = False  # whether it is straight at first, to where the robot comes before it turns

    @property
    def gears(self) -> Array:
        """(K - 1,) gear of each piece: 1 ahead, -1 backwards, 0 turning on the spot."""
        steps, headings = np.diff(self.poses[:, :2], axis=0), self.poses[:-1, 2]
        ahead = steps[:, 0] * np.cos(headings) + steps[:, 1] * np.sin(headings)
        has_gear = (np.abs(ahead) > ROUNDING) & (not self.sideways)
        gears: Array = np.where(has_gear, np.sign(ahead), 0.0).astype(int)
        return gears

    @property
    def between_turns(self) -> Path:
        """The same with a turn on the spot at either end, be it none."""
        poses, times = self.poses, self.times
        begins, ends = (
            math.dist(poses[i, :2], poses[j, :2]) > ROUNDING for i, j in ((0, 1), (-1, -2))
        )
        if len(poses) > 2 and not begins and not ends:
            return self
        last = len(poses) - 1
        chosen = [0] * begins + list(range(last + 1)) + [last] * ends
        return replace(self, poses=poses[chosen], times=None if times is None else times[chosen])

    def begun_at(self, point: Array) -> Path:
        """The path from another point (2,); this one where its first line is short for that."""
        poses = self.poses
        missed, line = math.dist(point, poses[1, :2]), poses[2, :2] - point
        is_arc = abs(poses[2, 2] - poses[1, 2]) > ROUNDING
        if is_arc or missed <= ROUNDING or math.hypot(*line.tolist()) < 2.0 * missed:
            return self
        poses = poses.copy()
        poses[:2, :2] = point
        course = poses[1, 2] + (math.pi if self.gears[1] < 0 else 0.0)
        poses[1:3, 2] += wrap(math.atan2(line[1], line[0]) - course)
        poses[1:, 2] -= nearest_turn(float(poses[1, 2] - poses[0, 2]))
        return replace(self, poses=poses)


class Planner(Protocol):
    """Finds paths; what it finds depends on the request alone.

    A search that was begun can be begun again from its request, by a copy of a controller or of its
    state, and must come to the same path.
    """

    def begin(self, request: PathRequest) -> None:
        """Begin a search; one that is under way is given up."""

    def advance(self, quanta: int) -> int:
        """Search on for so many quanta of 0.2 ms, or a little longer; return how many it took.

        A search that takes no time may do everything in `begin`.
        """

    def path(self) -> Path | str | None:
        """What was found: a path, or why there is none; None while the search is under way."""


class InMetres:
    """A user's planner, asked in metres and seconds by a guide that counts in the robot's units.

    `planner`: asked. `scale`: the robot's units.
    """

    def __init__(self, planner: Planner, scale: Scale) -> None:
        self._planner, self._scale = planner, scale

    def begin(self, request: PathRequest) -> None:
        """Begin a search."""
        self._planner.begin(request.in_metres(self._scale))

    def advance(self, quanta: int) -> int:
        """Search on."""
        return self._planner.advance(quanta)

    def path(self) -> Path | str | None:
        """What was found."""
        found, scale = self._planner.path(), self._scale
        if not isinstance(found, Path):
            return found
        times = None if found.times is None else found.times / scale.time
        clearance = found.clearance / scale.length
        return replace(found, poses=found.poses / scale.state, times=times, clearance=clearance)


GRID_STEP = 0.05
"""Time between neighbouring poses of a path, among which the robot's place is looked for [s]."""
FINE_STEP = 0.01  # the same of a car's path [s]
DECELERATION = 2.0
"""With which a car's path brakes where it ends or its gear changes: motors may lag unknown to the
model [m/s^2]."""
GRID_POSES = 20_000  # most poses of one path: a robot that hardly moves would need more than memory
CUSP_REACH = 0.012  # how short of a change of gear one that follows poses goes on in the other [m]
AT_GOAL = 1e-6  # distance that rounding leaves to the goal [m]


class TimedPath:
    """A path as it is driven (`timed`); it does not change.

    `path`: poses, and times where the planner has timed them. `speed`: speed [m/s] and rate of turn
    [rad/s] to drive at, (2,). `free_turn`: part of the first turn that is left to the controller,
    to be made while driving [rad]. `wheels`: how far a wheel drives for each radian that the robot
    turns [m], and its fastest speed [m/s]. `deceleration`: with which the drive ends [m/s^2];
    infinite if the robot stands at once.
    """

    def __init__(
        self,
        path: Path,
        speed: Array,
        free_turn: float = 0.0,
        wheels: tuple[float, float] = (0.0, math.inf),
        deceleration: float = math.inf,
    ) -> None:
        self.clearance = path.clearance
        path = path.between_turns
        # what turns on the spot, or drives sideways, has other pieces
        by_poses = path.times is not None and bool(path.gears[1:-1].all())
        if by_poses:
            deceleration = min(deceleration, DECELERATION)
            path = _beyond_cusps(path)
        gears = self._gears = path.gears
        poses = path.poses.copy()
        first = float(wrap(poses[1, 2] - poses[0, 2]))
        skipped = min(free_turn, abs(first))
        poses[0, 2] = poses[1, 2] - math.copysign(abs(first) - skipped, first)
        steps = np.diff(poses, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        turns = np.abs(steps[:, 2])
        needed = np.maximum(lengths / speed[0], turns / speed[1])
        # the outer wheel drives both
        needed = np.maximum(needed, (lengths + wheels[0] * turns) / wheels[1])
        if path.times is not None:
            needed = np.diff(path.times)
            needed[0] -= skipped / speed[1]  # left to the controller
        times = np.concatenate([[0.0], np.cumsum(np.maximum(needed, ROUNDING))])
        self.reverse = bool((gears < 0).sum() > (gears > 0).sum())
        """Whether most of it is driven backwards."""
        moved = np.flatnonzero(gears)
        changed = moved[1:][gears[moved[1:]] != gears[moved[:-1]]]
        if path.led:
            changed = np.union1d(changed, 1 + moved[:1])
        self.duration = float(times[-1])
        self.drive_end = float(times[-2])
        """When the goal's position is reached, and the last turn begins [s]."""
        step = max(FINE_STEP if by_poses else GRID_STEP, self.duration / GRID_POSES)
        braking = float(speed[0]) / deceleration
        self.timed = Timed(poses, times, times[changed], step, braking)

    @property
    def points(self) -> Array:
        """The path's points (K, 2) [m]."""
        return self.timed.poses[1:-1, :2]

    def at(self, times: Array) -> Array:
        """Poses (n, 3) at times (n,) [s]; the ends are held."""
        return poses_at(self.timed, times)

    def gear_at(self, time: float) -> int:
        """Gear, 1 or -1, of what is driven after a time [s]."""
        after = self.timed.times[1:] > time + ROUNDING
        return int(next(iter(self._gears[after & (self._gears != 0)]), 1))

    def share_at_goal(self, states: Array) -> float:
        """Share of the stages 1 to N of a reference (N + 1, 3) that have come to its goal."""
        away = np.maximum.reduce(np.abs(states[1:, :2] - self.timed.poses[-1, :2]), axis=1)
        return int(np.count_nonzero(away <= AT_GOAL)) / len(away)

    def route(self, pose: Array, place: float, lost: float) -> Route:
        """What is left of it for a robot at a pose (3,), after its place; time was lost [s]."""
        left = self.timed.times[1:-1] > place
        left[-1:] = True  # none between two poses
        points = np.concatenate([pose[None, :2], self.points[left]])
        return Route(points, self.reverse, self.clearance, lost)


def _beyond_cusps(path: Path) -> Path:
    """A timed path whose legs lead on by as much as the robot stops short of them.

    On an arc it has turned too little there, and where the gear changes again and again, as in a
    gap that it hardly fits, each leg would add to that.
    """
    poses, times, gears = path.poses, np.asarray(path.times), path.gears
    beyond = 0.75 * CUSP_REACH  # a robot that comes to it in whole periods stops there in the mean
    cusps = 1 + np.flatnonzero(gears[1:] * gears[:-1] < 0)
    steps = poses[cusps] - poses[cusps - 1]
    share = beyond / np.maximum(np.hypot(steps[:, 0], steps[:, 1]), ROUNDING)
    turns, ahead = share * steps[:, 2], gears[cusps - 1] * beyond
    middle = poses[cusps, 2] + 0.5 * turns
    ends = np.stack([ahead * np.cos(middle), ahead * np.sin(middle), turns], axis=1) + poses[cusps]
    lasts = np.repeat(share * (times[cusps] - times[cusps - 1]), 2)
    pieces = np.insert(np.diff(times), np.repeat(cusps, 2), lasts)
    back = np.stack([ends, poses[cusps]], axis=1).reshape(-1, 3)
    poses = np.insert(poses, np.repeat(cusps + 1, 2), back, axis=0)
    return replace(path, poses=poses, times=np.append(0.0, np.cumsum(pieces)))


def poses_along(geometry: GeometricPath, start: Array, goal: Array) -> Array:
    """Poses (K + 2, 3): the path's points between a turn at the start and one at the goal."""
    headings = geometry.headings + (math.pi if geometry.reverse else 0.0)
    first = float(wrap(headings[0] - start[2]))
    last = float(wrap(goal[2] - headings[-1]))
    headings = headings + (start[2] + first - headings[0])
    poses = np.empty((len(headings) + 2, 3))
    poses[1:-1, :2], poses[1:-1, 2] = geometry.points, headings
    poses[0] = (*geometry.points[0], start[2])
    poses[-1] = (goal[0], goal[1], headings[-1] + last)
    return poses
