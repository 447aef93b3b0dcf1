"""How a step looks around: what scans show goes into the map, if they still show anything.

A scanner that has died tells nothing, one that hangs the same. A range is noisy: a robot that has
moved never sees the same scan again, to the last bit. What comes again then is what was seen
before, from where the robot is not any more; it is left out.

A `View` is the map as the rooms of a step ask for it, from where the robot is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import COLUMNS, distances
from kmpc_lite.control.options import USUAL_OBSTACLES, SightOptions, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.local_map import IN_VAIN, UNKNOWN, LocalMap, cell_distances
from kmpc_lite.control.world.occupancy import Boxes, OccupancyGrid, count_runs
from kmpc_lite.control.world.scan import LaserScan, Layout, Outlooks, Rays, numbers_of, outlook_of
from kmpc_lite.control.world.solids import Nearby, Solids
from kmpc_lite.geometry import wrap
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

NONE_MOVING = np.empty((0, COLUMNS))
CELL_NOISE = 2.0  # least side of a cell, as a multiple of the standard deviation of the ranges
FREE_DISTANCE = 20.0
"""How far from the scanner cells are noted as seen to be free [radii]; beyond, only what stood
there before and is gone."""
STARE_DISTANCE = 6.0
"""How far from the scanner such cells are noted [radii]: what is farther is looked at again."""
FINEST = 3  # most cells side by side, for a path search, as one of the map
TRAIL = 64  # how many poses of the past are kept, to tell where old beams were sent from
SAME_PLACE = 0.5
"""How far the robot may have come, or its edge may have turned, since a scan that is told again
[radii]; what is told again from farther away is what the scanner saw before."""
NOISY = 8
"""Fewest hits that never come again by chance: a few may, along a wall and told in centimetres."""
PERIODS = 2.5  # fewest periods that scans may stay away: one may be late
SCANNERS = 16
"""Most scanners that are remembered: one whose beams lie otherwise each time is new each time."""
Scanner = tuple[tuple[float, float, float], Layout]
"""Where it is mounted, and how its beams lie: it may tell each half of its turn by itself."""


class Sight:
    """Keeps a local map up to date; what it remembers is the map alone.

    `problem`: radius, area and period, in the robot's units. `scale`: the robot's units. `options`:
    how long what is believed. `reach`: how far from the robot what was seen matters to a plan.
    """

    def __init__(
        self, problem: NavigationProblem, scale: Scale, options: SightOptions, reach: float
    ) -> None:
        unit = unit_length(problem)
        self.options, self._free = lengths_from_radii(options, unit), FREE_DISTANCE * unit
        self._stare = STARE_DISTANCE * unit
        self.reach, self.period = reach, problem.dt
        self._blind = options.blind_time / scale.time
        self.radius, self.footprint = problem.body_radius, problem.footprint
        # hits nearer than the first are the robot's own; within the second of its circles' middles
        # there is nothing but the robot
        self._inside = self._core = problem.robot_radius
        if problem.footprint is not None:
            self._inside = problem.footprint.inner_radius
            self._core = problem.footprint.core_radius
        self._area = problem.x_min[:2], problem.x_max[:2]

    def without_robot(self, scans: Sequence[LaserScan]) -> tuple[LaserScan, ...]:
        """Scans in which hits within the robot are not told: its mast, its arm."""
        return tuple(s.with_self_radius(self._inside) for s in scans)

    def look(
        self,
        before: LocalMap | None,
        scans: Sequence[LaserScan],
        pose: Array,
        pose_noise: float,
        moving: Array = NONE_MOVING,
    ) -> LocalMap | None:
        """Bring the map up to date.

        `before`: changed. `scans`: taken at the pose. None at all is a step without a scan. `pose`:
        (3,) as measured. `pose_noise`: standard deviation of its position. `moving`: (M, 7) things
        that move: what is hit of them is no part of the map.
        """
        begins = before is None
        if before is None:
            if not scans:
                return None
            before = self._begin(scans, pose)
        here, options = before, self.options
        here.clock += self.period
        here.follow(pose[:2], self.reach)
        scans = self.without_robot(scans)
        here.remember(pose, TRAIL, filter(None, map(outlook_of, scans)))
        here.forget(options.memory, self._blind)
        rays = list[Rays]()
        for scan in scans:
            taken = pose  # where the robot was then, (3,) or (B, 3)
            if scan.age or scan.time_increment:
                taken = here.poses_at(scan.ages if scan.time_increment else np.array(scan.age))
            rays.append(ray := Rays(scan, taken, here.cell))
            self._clear(here, ray)
            self._look_in_vain(here, ray)
        if rays:
            hits = np.concatenate([ray.hits for ray in rays])
            deviations = np.concatenate([ray.deviations for ray in rays])
            errors = options.certainty * np.hypot(deviations, pose_noise)
            if len(moving):
                gaps = distances(moving, hits, np.zeros(len(hits)))
                stands = (gaps > here.cell).all(axis=1)
                hits, errors = hits[stands], errors[stands]
            self._mark(here, hits, errors)
        # what the robot overlaps by a part is free where it begins; later it must have been seen
        around = math.sqrt(0.5) * here.cell + options.free_at_start
        self._stand(here, pose, self.radius + begins * around)
        return here

    def _begin(self, scans: Sequence[LaserScan], pose: Array) -> LocalMap:
        """Begin a map that holds the whole area where that is small, else the neighbourhood."""
        options, noise = self.options, max(scan.noise for scan in scans)
        # no finer than the scanner sees
        cell = options.cell * max(1, math.ceil(CELL_NOISE * noise / options.cell))
        low, high = self._area
        low, high = low - self.reach - cell, high + self.reach + cell
        half = 0.5 * options.most_cells * cell
        if (high - low <= 2.0 * half).all():
            return LocalMap.around(low, high, cell, True)
        return LocalMap.around(pose[:2] - half, pose[:2] + half, cell, False)

    def _clear(self, here: LocalMap, rays: Rays) -> None:
        """Take note of what rays passed through; farther away only of what was occupied."""
        distance = min(self._free, rays.farthest)
        area = rays.low.tolist(), rays.high.tolist(), rays.origin.tolist()
        cells, passed = (here.state, here.seen, here.extent), (rays.turn, rays.squares, distance)
        farther = rays.farthest > distance
        library.pass_rays(*cells, here.place, *area, *passed, farther, here.clock)

    def _look_in_vain(self, here: LocalMap, rays: Rays) -> None:
        """Count the scans in a row that have looked at unknown cells nearby in vain."""
        if rays.vain is None or rays.farthest == 0.0:
            return  # a scanner that is dead looks nowhere
        window = here.window(rays.origin, self._stare)
        x, y = (axis.astype(np.float32) for axis in here.centres(window))
        x, y = x[None] - np.float32(rays.origin[0]), y[:, None] - np.float32(rays.origin[1])
        (cos, sin), part = rays.turn, here.state[window[0] : window[1], window[2] : window[3]]
        numbers = numbers_of(cos * x + sin * y, cos * y - sin * x)
        looks = rays.vain.take(numbers, mode="wrap") & (x * x + y * y < self._stare**2)
        counts = np.where(looks, np.maximum(part - 1, IN_VAIN), UNKNOWN)
        np.copyto(part, counts, where=(part <= UNKNOWN) & (part > IN_VAIN))

    def _mark(self, here: LocalMap, hits: Array, errors: Array) -> None:
        """Mark the cells of hits (n, 2), which may be off by errors (n,), as occupied."""
        cells = here.state, here.seen, here.extent, here.taken
        last = here.place, self.options.passes, here.clock
        library.mark(*cells, hits, errors, *last)

    def _stand(self, here: LocalMap, pose: Array, reach: float) -> None:
        """Where the robot stands, within a reach of its centre, nothing else does."""
        arms = 0.0 if self.footprint is None else self.footprint.reach
        window = here.window(pose[:2], reach + arms)
        distance = cell_distances(here, window, self.footprint, pose)
        area = slice(*window[:2]), slice(*window[2:])
        state, under = here.state[area], distance <= reach
        state[under & (state <= UNKNOWN)] = 0
        state[distance <= self._core - here.cell] = 0
        here.seen[area][under] = here.clock


@dataclass(frozen=True, eq=False, slots=True)
class LastScan:
    """What a scanner told last, and where the robot was when it told it first."""

    ranges: bytes  # (B,) [m]
    pose: Array  # (3,)


@dataclass(slots=True)
class ScanWatchState:
    """What scanners have told, and since when they tell nothing."""

    last: dict[Scanner, LastScan] = field(default_factory=dict)
    """The one that told something last at the end."""
    silent: float = 0.0  # for how long nothing new was told [s]


class ScanWatch:
    """Leaves out scans that come again, and says when the robot is blind.

    `problem`: radius, in the robot's units. `options`: how far and how long. `period`: between two
    steps [s].
    """

    def __init__(self, problem: NavigationProblem, options: SightOptions, period: float) -> None:
        self._same, self._period = SAME_PLACE * unit_length(problem), period
        self._limit = max(options.blind_time, PERIODS * period)

    def see(
        self, state: ScanWatchState, scans: Sequence[LaserScan], pose: Array
    ) -> tuple[tuple[LaserScan, ...], str]:
        """Take in the scans of a step.

        `state`: updated. `scans`: without hits of the robot itself, which it carries along. None is
        a step without a scan. `pose`: (3,) of the robot, in its units. Returns `scans`: without
        those that came before, from elsewhere; `reason`: why the robot must not drive on; empty if
        it sees, or never had a scan.
        """
        if not scans and not state.last:
            return (), ""
        new = tuple(scan for scan in scans if self._is_new(state, scan, pose))
        if any(scan.hits.any() or scan.clear.any() for scan in new):
            state.silent = 0.0
            return new, ""
        state.silent += self._period
        if state.silent <= self._limit:
            return new, ""
        hangs = len(new) < len(scans)
        what = "have not changed while the robot moved" if hangs else "have told nothing"
        return new, f"scans {what} for {self._limit:g} s or longer: it does not drive blind"

    def _is_new(self, state: ScanWatchState, scan: LaserScan, pose: Array) -> bool:
        """Whether a scan is another one than the scanner's last, or the robot has hardly moved."""
        scanner, ranges = (scan.mount, scan.layout), scan.ranges.tobytes()
        before = state.last.pop(scanner, None)
        if before is None or before.ranges != ranges:
            state.last[scanner] = LastScan(ranges, pose.copy())
            if len(state.last) > SCANNERS:
                del state.last[next(iter(state.last))]
            return True
        state.last[scanner] = before
        if np.count_nonzero(scan.hits) < NOISY:
            return True
        x, y, turn = (pose - before.pose).tolist()
        near = x * x + y * y <= self._same**2
        return near and abs(float(wrap(turn))) <= SAME_PLACE


NOTHING = Solids([]).whole  # no solids
WORLD = OccupancyGrid([[0]], 1.0)
"""A grid in the world's own frame, for rectangles that belong to none."""


class View:
    """The local map as the rooms of a step ask for it.

    `sight`: how far it looks. `here`: what was seen. `pose`: (3,) of the robot.
    """

    def __init__(self, sight: Sight, here: LocalMap, pose: Array) -> None:
        self._sight, self._map, self._pose = sight, here, pose
        self._outlooks = Outlooks(here.outlooks[:, :4])
        self.is_narrow = self._outlooks.is_narrow
        """Whether there are directions in which no scanner looks."""
        self._hits, self._unknown = self._look()
        self.hits = NOTHING.with_boxes(self._hits) if self._hits else None
        """What was hit near the robot; none if nothing was."""
        self.unknown = NOTHING.with_boxes(self._unknown) if self._unknown else None
        """What was not seen to be free near the robot; none if all was."""

    def around(self, solids: Nearby | None) -> Nearby | None:
        """Solids that the robot can come to, what was hit, and what was not seen to be free."""
        more = [*self._hits, *self._unknown]
        if not more:
            return solids
        return (NOTHING if solids is None else solids).with_boxes(more)

    def is_dark(self, points: Array, distance: float) -> Array:
        """Which of points (n, 2) near the robot lie within a distance of what is unknown, (n,)."""
        if self.unknown is None:
            return np.zeros(len(points), dtype=bool)
        found: Array = self.unknown.least(points) < distance
        return found

    def leads_into_dark(self, points: Array, place: Array, distance: float) -> Array:
        """At which of points (n, 2) a robot comes nearer to what is unknown than it is, (n,).

        `points`: near the robot. `place`: (2,) where it is. `distance`: what it needs around it:
        there may be darkness farther away.
        """
        if self.unknown is None:
            return np.zeros(len(points), dtype=bool)
        # what stands out by less than a quarter of a cell is rounding
        least = min(distance, float(self.unknown.least(place[None])[0])) - 0.25 * self._map.cell
        found: Array = self.unknown.least(points) < least
        return found

    def turns_to_see(self, points: Array, distance: float, slack: float) -> Array:
        """Turns [rad] to what is unknown near points (n, 2), and is not looked at, (m,)."""
        if not self._unknown:
            return np.empty(0)
        boxes, inside = self._unknown[0], 0.5 * self._map.cell
        nearest = np.clip(points[:, None], boxes.low, boxes.high)
        near = np.hypot(*(points[:, None] - nearest).transpose(2, 0, 1)) < distance
        # a cell has been seen when its middle was
        middles = np.clip(points[:, None], boxes.low + inside, boxes.high - inside)
        return self._outlooks.turns(self._pose, middles[near], slack)

    def blind_turn(self, direction: float) -> float:
        """How far a robot must turn until it sees what lies in a direction in its frame [rad]."""
        return float(self._outlooks.beyond(np.array([direction]))[0]) if self.is_narrow else 0.0

    def unknown_cells(self) -> tuple[Array, Array, float]:
        """Cells (H, W) of which nothing is known, where the first begins (2,), and their side."""
        return self._map.state <= UNKNOWN, self._map.corner, self._map.cell

    def _look(self) -> tuple[list[Boxes], list[Boxes]]:
        """What was hit near the robot, and what was never seen to be free."""
        here, sight = self._map, self._sight
        window = here.window(self._pose[:2], sight.reach)
        top, bottom, left, right = window
        area = slice(top, bottom), slice(left, right)
        hits = library.hit_boxes(here.state, here.extent, window, here.place)
        unknown = here.state[area] <= UNKNOWN
        left, bottom = left + here.column, top + here.row
        sides = here.cell * (library.rectangles(unknown) + (left, bottom, left, bottom))
        # a wall is told by few half-planes, noise and all
        found = [Boxes(*hits, WORLD, here.cell)] if len(hits[0]) else []
        dark = [Boxes(sides[:, :2], sides[:, 2:], WORLD, here.cell)] if len(sides) else []
        return found, dark

    def solids(self, given: Solids | None) -> tuple[Solids | None, float]:
        """All that is known to be occupied, with solids that are given, for a path search.

        And how far cells may stand out of what was hit in them: a small map gets finer ones.
        """
        here, side, (height, width) = self._map, self._map.cell, self._map.state.shape
        low, high = library.hit_boxes(here.state, here.extent, (0, height, 0, width), here.place)
        row, column = (here.state <= IN_VAIN).nonzero()
        vain = side * (np.array((column, row)).T + (here.column, here.row))
        # what may be anywhere for its noise is no reason for a larger map
        ends = here.corner, here.corner + side * np.array((width, height))
        low = np.clip(np.concatenate([low, vain]), *ends)
        high = np.clip(np.concatenate([high, vain + side]), *ends)
        if not len(low):
            return given, 0.0
        sides = ((high.max(axis=0) - low.min(axis=0)) / side + 1.0).tolist()
        most = self._sight.options.most_cells / math.sqrt(sides[0] * sides[1])
        cell = side / min(max(int(most), 1), FINEST)
        first, behind = np.floor(low / cell).astype(int), np.floor(high / cell).astype(int) + 1
        corner = cell * (begin := first.min(axis=0))
        (left, bottom), (right, top) = (first - begin).T, (behind - begin).T
        # in how many boxes a cell lies: sums over the corners of the boxes
        count = np.zeros((top.max() + 1, right.max() + 1), dtype=np.int32)
        np.add.at(count, (np.append(bottom, top), np.append(left, right)), 1)
        np.add.at(count, (np.append(bottom, top), np.append(right, left)), -1)
        count = count.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
        occupied = count[:-1, :-1] > 0
        # of dense noise: in larger cells, which hold all that the smaller ones did
        while count_runs(occupied) > USUAL_OBSTACLES.grid_runs:
            height, width = occupied.shape
            even = np.pad(occupied, ((0, height % 2), (0, width % 2)))
            occupied = (even[::2] | even[1::2])[:, ::2] | (even[::2] | even[1::2])[:, 1::2]
            cell *= 2.0
        others = () if given is None else given.solids
        found = Solids([*others, OccupancyGrid(occupied, cell, corner)])
        return found, math.sqrt(2.0) * cell

    def blocks(self, points: Array, distance: float) -> bool:
        """Whether something that was hit is nearer than a distance to any of points (n, 2)."""
        here = self._map
        points = points[here.is_near(points, distance)]
        if not len(points):
            return False
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half = 0.5 * (low + high), float((high - low).max()) / 2.0
        window = here.window(middle, half + distance + here.cell)
        boxes = library.hit_boxes(here.state, here.extent, window, here.place)
        near = ((boxes[1] > low - distance) & (boxes[0] < high + distance)).all(axis=1)
        boxes = boxes[0][near], boxes[1][near]
        return bool(near.any() and library.box_distances(*boxes, points).min() < distance)
