"""The obstacles of a step.

Circles are rows of an array; solids are prepared once, and serve for as long as they last.

What a robot must stay clear of until it stands, and how near it comes, is one function for all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import (
    COLUMNS,
    SPREAD,
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
    some_move,
    some_spread,
)
from kmpc_lite.control.options import USUAL_OBSTACLES, ObstacleOptions
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall, circles_to_array
from kmpc_lite.geometry import rotate
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.world.solids import Body, Nearby, Solids

SOLID = (Polygon, Wall, OccupancyGrid)
PREPARED = (*SOLID, LaserScan)
Solid = Polygon | Wall | OccupancyGrid
Obstacle = Circle | Solid | LaserScan
Obstacles = Sequence[Obstacle] | ArrayLike
NO_CIRCLES = circles_to_array(())
MOST_SCANS = MOST_GRIDS = 10  # laser scans, and grids, of one step


@dataclass(slots=True)
class SceneState:
    """The solids that were prepared last."""

    given: tuple[Solid, ...] = ()  # as the caller gave them, in metres
    solids: Solids | None = None  # the same, prepared, in the robot's units
    looked_from: Array | None = None  # (2,) where those that are near were looked up last


def too_many(circles: int, solids: Sequence[Solid], scans: int, most: ObstacleOptions) -> str:
    """Say of which obstacles a step looks at fewer than are given; nothing if it bears them.

    Told by their numbers alone, before any of them is looked at.
    """
    corners = polygons = walls = grids = cells = runs = 0
    for solid in solids:
        if isinstance(solid, OccupancyGrid):
            grids, cells, runs = grids + 1, cells + solid.occupied.size, runs + solid.runs
        elif isinstance(solid, Polygon):
            polygons, corners = polygons + 1, max(corners, len(solid.vertices))
        else:
            walls += 1
    for count, allowed, what in (
        (circles, most.circles, "circles"),
        (scans, MOST_SCANS, "scans"),
        (walls + polygons * corners, most.edges, "edges of polygons and walls"),
        (grids, MOST_GRIDS, "grids"),
        (cells, most.grid_cells, "cells of grids"),
        (runs, most.grid_runs, "runs of occupied cells of grids"),
    ):
        if count > allowed:
            return f"{count:,} {what}: at most {allowed:,} are looked at"
    return ""


class Scene:
    """Sorts obstacles, and looks up those that the robot can come to.

    `unit`: metres of one unit of the robot's lengths. `reach`: how far from the robot solids count,
    in units. `lookup_distance`: how far the robot drives before they are looked up again, in units.
    `most`: how many are looked at.
    """

    def __init__(
        self,
        unit: float,
        reach: float,
        lookup_distance: float,
        most: ObstacleOptions = USUAL_OBSTACLES,
    ) -> None:
        self._unit, self._reach, self._lookup_distance = unit, reach, lookup_distance
        self._most = most
        self._nearby: tuple[Solids, Array, Nearby] | None = None

    def sort(
        self, state: SceneState, obstacles: Obstacles
    ) -> tuple[str, Array, Solids | None, tuple[LaserScan, ...]]:
        """Why they are too many; circles (M, 5) and scans in metres, and solids in units if any.

        Raises ValueError for what is neither circles, nor solids, nor an array of circles.
        """
        # an array of no dimension has no length, though it is sized
        sized = isinstance(obstacles, Sized) and getattr(obstacles, "ndim", 1) > 0
        most, total = self._most, len(cast(Sized, obstacles)) if sized else 0
        circles, solids, scans = obstacles, list[Solid](), list[LaserScan]()
        if isinstance(obstacles, Sequence) and not isinstance(obstacles, np.ndarray):
            if total > most.circles + most.edges:
                refusal = f"{total:,} obstacles: at most {most.circles:,} circles are looked at"
                return refusal, NO_CIRCLES, None, ()
            # of many, there are few kinds
            if any(issubclass(kind, PREPARED) for kind in set(map(type, obstacles))):
                circles = _sorted(cast(Sequence[Obstacle], obstacles), solids, scans)
        refusal = too_many(total - len(solids) - len(scans), solids, len(scans), most)
        if refusal:
            return refusal, NO_CIRCLES, None, ()
        rows = circles_to_array(cast(ArrayLike, circles))
        if not solids:
            return "", rows, None, tuple(scans)
        # sequences compare their items by identity first, which is all it takes for the same ones
        given = tuple(solids)
        if state.solids is None or state.given != given:
            # here, since most maps have none
            from kmpc_lite.control.world.solids import Solids

            state.given = given
            state.solids = Solids(
                [o if self._unit == 1.0 else o.scaled(self._unit) for o in solids]
            )
            state.looked_from = None
        return "", rows, state.solids, tuple(scans)

    def near(self, state: SceneState, solids: Solids | None, point: Array) -> Nearby | None:
        """Solids within reach of a point (2,), and perhaps some farther ones.

        They are looked up anew only when the robot has moved on.
        """
        if solids is None:
            return None
        before = state.looked_from
        if before is None or not np.abs(point - before).max() <= self._lookup_distance:
            state.looked_from = before = point.copy()
        known = self._nearby
        if known is None or known[0] is not solids or not np.array_equal(known[1], before):
            # beyond the reach by as much as the robot may drive until the next look
            within = self._reach + 2.0 * self._lookup_distance
            self._nearby = known = solids, before, solids.within(before, within)
        return known[2]


def _sorted(
    obstacles: Sequence[Obstacle], solids: list[Solid], scans: list[LaserScan]
) -> list[Circle]:
    """Put solids and scans apart, and give the others."""
    circles = []
    for one in obstacles:
        if isinstance(one, LaserScan):
            scans.append(one)
        elif isinstance(one, SOLID):
            solids.append(one)
        else:
            circles.append(one)
    return circles


NONE = np.empty((0, COLUMNS))
KNOWN = np.empty(0)


class Surroundings:
    """Things around a robot.

    A moving obstacle counts twice: where its velocity leads it, and wherever it can turn to.

    `things`: (M, 7) what is round, as it is now: a table of `kernels.clearance`. `nearby`: solids
    that the robot can come to. `perhaps`: (P, 7) what may be walking, and is else known as
    something that stands. `unsure`: (M,) what is not known of the speeds of things; (0,) if all are
    known. `swerve_time`: for how long a moving obstacle may walk in any direction [s]. `known`: how
    far from the middles of the robot's circles everything is known [m].

    Attributes: `turning`: (W, 7) what may turn: spreads from where it is, as fast as it can be
    walking.
    """

    def __init__(
        self,
        things: Array,
        nearby: Nearby | None = None,
        perhaps: Array = NONE,
        unsure: Array = KNOWN,
        swerve_time: float = 0.0,
        known: float = math.inf,
    ) -> None:
        self.things, self.nearby, self.known = things, nearby, known
        self.is_empty = not (len(things) or len(perhaps) or nearby) and known == math.inf
        self.turning, straight = NONE, things
        if len(perhaps) or some_move(things) or np.count_nonzero(unsure):
            turning = np.concatenate([things, perhaps])
            speeds = np.hypot(turning[:, 3], turning[:, 4])
            speeds[: len(unsure)] += unsure
            turning[:, VELOCITY] = 0.0
            turning[:, SPREAD_RATE] = speeds
            turning[:, SPREAD_MAX] = speeds * swerve_time
            self.turning = turning[speeds > 0.0]
        if some_spread(things):
            straight = things.copy()
            straight[:, SPREAD] = 0.0
        # things where their velocities lead them, then what may turn
        self._all = np.concatenate([straight, self.turning]) if len(self.turning) else straight

    @property
    def may_turn(self) -> Array:
        """Which of the things that `clearance` measures may turn towards the robot, (K,)."""
        after = bool(self.nearby) + (self.known < math.inf)
        return np.repeat((False, True, False), (len(self.things), len(self.turning), after))

    def fastest(self) -> float:
        """Largest speed at which anything may come nearer [m/s]."""
        return float(np.maximum.reduce(self.turning[:, SPREAD_RATE], initial=0.0))

    def clearance(
        self, points: Array, times: Array, here: Array, body: Body | None = None
    ) -> Array:
        """Distances from points to the edges of all things.

        `points`: (C, Q, E, 2); Q may be 1 for points at rest [m]. `times`: (Q,) from now [s].
        `here`: (E, 2) where the points are now [m]. `body`: footprint and poses (C Q, 3) whose
        circles the points are. Returns (C, Q, E, K) [m], negative inside.
        """
        shape = (len(points), len(times), len(here))
        found = []
        if len(self._all):
            found.append(library.distances_of_motions(self._all, points, times))
        if self.nearby:
            least = self.nearby.least(points.reshape(-1, 2), body)
            least = least.reshape(*points.shape[:3], 1)
            moves = points.shape[1] == len(times)
            found.append(least if moves else np.broadcast_to(least, (*shape, 1)))
        if self.known < math.inf:
            # as the distance from an obstacle all around
            away = np.broadcast_to(np.hypot(*np.moveaxis(points - here, -1, 0)), shape)
            found.append((self.known - away)[..., None])
        return found[0] if len(found) == 1 else np.concatenate(found, axis=-1)

    def slopes(
        self, here: Array, pose: Array, step: float, footprint: Footprint | None = None
    ) -> Array:
        """By how much clearances grow with the pose, in the robot's frame (E, K, 3).

        `here`: (E, 2) middles of the robot's circles [m]. `pose`: (3,) of the robot. `step`: of the
        differences that are taken [m]. `footprint`: whose circles the points are.
        """
        steps = step * np.array(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
        moved, body = here + steps[:, None], None
        if footprint is not None:
            body = footprint, pose + np.pad(steps, ((0, 0), (0, 1)))
        found = self.clearance(moved[:, None], np.zeros(1), here, body)[:, 0]
        slopes, arms = (found[1:] - found[0]) / step, here - pose[:2]
        # none is steeper than one, but for rounding: an outline's next nearest point jumps
        size = np.hypot(*slopes)
        x, y = np.where(size > 1.001, slopes / size, slopes)
        out = np.empty((*x.shape, STATES))
        out[..., 0], out[..., 1] = rotate(x, y, -float(pose[2]))
        out[..., 2] = arms[:, :1] * y - arms[:, 1:] * x
        return out
