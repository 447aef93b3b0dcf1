"""How a step looks around: scans into the map, and from it what must not be driven into."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.kernels.clearance import COLUMNS, distances
from kmpc_lite.control.kernels.scan_map import Window, numbers_of
from kmpc_lite.control.options import SightOptions, lengths_from_radii, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.boxes import Boxes
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.sight.local_map import UNKNOWN, LocalMap, side_of
from kmpc_lite.control.world.sight.outlook import outlook_of
from kmpc_lite.control.world.sight.rays import Rays
from kmpc_lite.control.world.sight.view import View
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

WORLD = OccupancyGrid([[0]], 1.0)
"""A grid in the world's own frame, for rectangles that belong to none."""
NONE_MOVING = np.empty((0, COLUMNS))
CELL_NOISE = 2.0
"""Least side of a cell, as a multiple of the standard deviation of the ranges."""
MAP_REACH = 2.0
"""Distance to the map's edge from its middle, as a multiple of the scanner's reach, where the map
does not hold the whole area."""
FREE_DISTANCE = 20.0
"""How far from the scanner cells are noted as seen to be free [radii]; beyond, only what stood
there before and is gone."""
IN_VAIN = UNKNOWN - 10
"""State of cells at which so many scans in a row have looked in vain: something is there that tells
nothing, such as a pane of glass, and paths lead around it."""
STARE_DISTANCE = 6.0
"""How far from the scanner such cells are noted [radii]: what is farther is looked at again."""
TRAIL = 64
"""How many poses of the past are kept, to tell where old beams were sent from."""


class Seen(NamedTuple):
    """What a step needs of what was seen, near the robot."""

    hits: list[Boxes]
    """What was hit."""
    unknown: list[Boxes]
    """What was never seen to be free."""


class Sight:
    """Keeps a local map up to date; what it remembers is the map alone.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, area and period, in the robot's units.
    scale : Scale
        The robot's units.
    options : SightOptions
        How long what is believed.
    reach : float
        How far from the robot what was seen matters to a plan.
    kernels : Kernels
        Compute.
    """

    def __init__(
        self,
        problem: NavigationProblem,
        scale: Scale,
        options: SightOptions,
        reach: float,
        kernels: Kernels = NUMPY,
    ) -> None:
        self._kernels = kernels
        unit = unit_length(problem)
        self.options, self._free = lengths_from_radii(options, unit), FREE_DISTANCE * unit
        self._stare = STARE_DISTANCE * unit
        self._reach, self._dt = reach, problem.dt
        self._blind = options.blind_time / scale.time
        self._radius, self._footprint = problem.body_radius, problem.footprint
        # hits nearer than the first are the robot's own; within the second of its circles' middles
        # there is nothing but the robot
        self._inside = self._core = problem.robot_radius
        if problem.footprint is not None:
            self._inside = problem.footprint.inner_radius
            self._core = problem.footprint.core_radius
        self._area = problem.x_min[:2], problem.x_max[:2]
        self._emerging = options.emerging_speed / scale.speed

    def without_robot(self, scans: Sequence[LaserScan]) -> tuple[LaserScan, ...]:
        """Scans in which hits within the robot are not told: its mast, its arm."""
        return tuple(s.with_self_radius(self._inside, self._kernels) for s in scans)

    def look(
        self,
        before: LocalMap | None,
        scans: Sequence[LaserScan],
        pose: Array,
        pose_noise: float,
        moving: Array = NONE_MOVING,
    ) -> LocalMap | None:
        """Bring the map up to date.

        Parameters
        ----------
        before : LocalMap or None
            Changed.
        scans : sequence of LaserScan
            Taken at the pose. None at all is a step without a scan.
        pose : ndarray
            (3,) as measured.
        pose_noise : float
            Standard deviation of its position.
        moving : ndarray
            (M, 7) things that move: what is hit of them is no part of the map.
        """
        begins = before is None
        if before is None:
            if not scans:
                return None
            before = self._begin(scans, pose)
        here, options = before, self.options
        here.clock += self._dt
        here.follow(pose[:2], self._reach)
        here.remember_pose(pose, TRAIL)
        here.forget(options.memory, self._blind)
        scans = self.without_robot(scans)
        for scan in scans:
            look = outlook_of(scan)
            if look is not None:
                here.look_out(look)
        rays = [Rays(s, self._pose_of(here, s, pose), here.cell, self._kernels) for s in scans]
        for ray in rays:
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
        self._stand(here, pose, self._radius + begins * around)
        return here

    def view(self, here: LocalMap, pose: Array) -> View:
        """What is known around a robot at a pose (3,)."""
        return View(self, here, pose)

    def seen(self, here: LocalMap, pose: Array) -> Seen:
        """What a robot at a pose (3,) must not drive into."""
        window = here.window(pose[:2], self._reach)
        top, bottom, left, right = window
        area = slice(top, bottom), slice(left, right)
        state = here.state[area]
        low, high = self._kernels.hit_boxes(here.state, here.extent, window, here.place)
        unknown = state <= UNKNOWN
        if self._emerging > 0.0:
            # something may come out of what is not seen now
            unknown = unknown | ((state == 0) & (here.seen[area] < here.clock - self._dt))
            unknown &= self._distance(here, window, pose) > self._radius + here.cell
        left, bottom = left + here.column, top + here.row
        sides = here.cell * (self._kernels.rectangles(unknown) + (left, bottom, left, bottom))
        # a wall is told by few half-planes, noise and all
        dark = _boxes(sides[:, :2], sides[:, 2:], here.cell)
        return Seen(_boxes(low, high, here.cell), dark)

    def solids(self, here: LocalMap, given: Solids | None) -> Solids | None:
        """All that is known to be occupied, as solids for a path search."""
        is_hit = (here.state > 0) | (here.state <= IN_VAIN)
        rows, columns = (np.flatnonzero(is_hit.any(axis=axis)) for axis in (1, 0))
        others = [] if given is None else list(given.solids)
        if not len(rows):
            return given
        (top, bottom), (left, right) = rows[[-1, 0]] + (1, 0), columns[[0, -1]] + (0, 1)
        occupied = is_hit[bottom:top, left:right]
        corner = here.cell * np.array([here.column + left, here.row + bottom])
        return Solids([*others, OccupancyGrid(occupied, here.cell, corner)])

    def blocks(self, here: LocalMap, points: Array, distance: float) -> bool:
        """Whether something stands nearer than a distance to any of the points (n, 2)."""
        points = points[here.is_near(points, distance)]
        if not len(points):
            return False
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half = 0.5 * (low + high), float((high - low).max()) / 2.0
        window = here.window(middle, half + distance + here.cell)
        boxes = self._kernels.hit_boxes(here.state, here.extent, window, here.place)
        near = ((boxes[1] > low - distance) & (boxes[0] < high + distance)).all(axis=1)
        begin, end = (corners[near] for corners in boxes)
        x, y = (
            np.maximum(begin[:, i, None] - points[:, i], points[:, i] - end[:, i, None])
            for i in (0, 1)
        )
        np.maximum(x, 0.0, out=x)
        np.maximum(y, 0.0, out=y)
        x *= x
        y *= y
        x += y
        return bool(x.min(initial=np.inf) < distance * distance)

    def _begin(self, scans: Sequence[LaserScan], pose: Array) -> LocalMap:
        """Begin a map that holds the whole area where that is small, else the neighbourhood."""
        options, noise = self.options, max(scan.noise for scan in scans)
        cell = side_of(options.cell, noise, CELL_NOISE)
        low, high = self._area
        low, high = low - self._reach - cell, high + self._reach + cell
        most = options.most_cells * cell
        if (high - low <= most).all():
            return LocalMap.around(low, high, cell, True)
        reach = max(scan.range_max for scan in scans)
        half = min(max(MAP_REACH * reach, 2.0 * self._reach), 0.5 * most)
        return LocalMap.around(pose[:2] - half, pose[:2] + half, cell, False)

    def _pose_of(self, here: LocalMap, scan: LaserScan, pose: Array) -> Array:
        """Where the robot was when a scan was taken, (3,) or (B, 3)."""
        if not scan.age and not scan.time_increment:
            return pose
        ages = scan.ages if scan.time_increment else np.array(scan.age)
        return here.poses_at(ages)

    def _clear(self, here: LocalMap, rays: Rays) -> None:
        """Take note of what rays passed through; farther away only of what was occupied."""
        distance = min(self._free, rays.farthest)
        area = rays.low.tolist(), rays.high.tolist(), rays.origin.tolist()
        cells, passed = (here.state, here.seen, here.extent), (rays.turn, rays.squares, distance)
        farther = rays.farthest > distance
        self._kernels.pass_rays(*cells, here.place, *area, *passed, farther, here.clock)

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
        self._kernels.mark(*cells, hits, errors, *last)

    def _stand(self, here: LocalMap, pose: Array, reach: float) -> None:
        """Where the robot stands, within a reach of its centre, nothing else does."""
        arms = 0.0 if self._footprint is None else self._footprint.reach
        window = here.window(pose[:2], reach + arms)
        distance = self._distance(here, window, pose)
        area = slice(*window[:2]), slice(*window[2:])
        state, under = here.state[area], distance <= reach
        state[under & (state <= UNKNOWN)] = 0
        state[distance <= self._core - here.cell] = 0
        here.seen[area][under] = here.clock

    def _distance(self, here: LocalMap, window: Window, pose: Array) -> Array:
        """Distances of the middles of a window's cells from the nearest of its circles' middles."""
        x, y = here.centres(window)
        places = places_of(self._footprint, pose)
        away = np.hypot(x[:, None] - places[:, 0], y[:, None, None] - places[:, 1])
        return np.asarray(away.min(axis=-1))


def _boxes(low: Array, high: Array, behind: float) -> list[Boxes]:
    return [Boxes(low, high, WORLD, behind)] if len(low) else []
