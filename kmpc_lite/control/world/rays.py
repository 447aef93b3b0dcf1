"""What beams look at: which way a scanner looks, and what it shows in each direction."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import scan_library
from kmpc_lite.control.kernels.scan_library import Singles
from kmpc_lite.control.world.scan import LaserScan, Layout, Sector, beams, counted
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

BEYOND = 1e-6
"""How far beyond its end a sector is looked at, to tell whether another one goes on there [rad]."""
EQUAL = 1e-9
"""Difference of two angles that is rounding [rad]."""
DIRECTIONS = 2048
"""Directions that are told apart all around: the beams of the finest scanner that is usual."""
NOTHING = 1e-15
"""Keeps a quotient finite: what it is added to changes by less than rounding."""


def numbers_of(x: Singles, y: Singles) -> NDArray[np.intp]:
    """Number directions (x, y) from 0, straight back, counter-clockwise.

    Without an arc tangent: by the sum of both sides of a triangle. Straight back has the number
    DIRECTIONS, too.
    """
    size: Singles = np.abs(x)
    size += np.abs(y)
    size += NOTHING
    turn = np.divide(x, size, out=size)
    turn *= -0.25 * DIRECTIONS
    turn += 0.25 * DIRECTIONS
    np.copysign(turn, y, out=turn)
    turn += 0.5 * DIRECTIONS
    return turn.astype(np.intp)


def outlook_of(scan: LaserScan) -> tuple[float, float, float, float] | None:
    """Where the scanner of a scan looks, in the robot's frame; none if no beam counts.

    Its x and y, the direction of the middle of what it sees, and how far to either side it sees
    [rad]; pi: all around.
    """
    sector = _sector(scan.layout, scan.ignore)
    if sector is None:
        return None
    return *scan.mount[:2], *sector


@lru_cache(maxsize=16)
def _sector(layout: Layout, ignore: tuple[Sector, ...]) -> Sector | None:
    """Middle and half of all directions but the widest gap between beams [rad]."""
    directions = beams(*layout)[0]
    for begin, end in ignore:
        directions = directions[
            np.mod(directions - begin, math.tau) > np.mod(end - begin, math.tau)
        ]
    if not len(directions):
        return None
    known = np.sort(wrap(directions))
    gaps = np.diff(known, append=known[0] + math.tau)
    widest = int(gaps.argmax())
    gap = float(gaps[widest])
    if gap <= 2.0 * abs(layout[2]):
        return 0.0, math.pi
    return float(wrap(known[widest] + 0.5 * gap + math.pi)), math.pi - 0.5 * gap


class Outlooks:
    """Where all scanners of a robot look.

    `rows`: (S, 4) of each scanner, as of `outlook_of`.
    """

    def __init__(self, rows: Array) -> None:
        self._rows = rows
        ends = self._rows[:, 2] + self._rows[:, 3] + BEYOND
        halves = self._rows[:, 3]
        some = len(halves) > 0 and float(halves.max()) < math.pi
        self.is_narrow = some and bool((self.beyond(ends) > 0.0).any())
        """Whether there are directions in which none looks; not if there is none at all."""

    def beyond(self, directions: Array) -> Array:
        """How far directions (n,) in the robot's frame lie beyond what is seen, (n,) [rad]."""
        off = np.abs(wrap(directions[:, None] - self._rows[:, 2])) - self._rows[:, 3]
        found: Array = np.maximum(off, 0.0).min(axis=1)
        return found

    def turns(self, pose: Array, points: Array, slack: float) -> Array:
        """Turns [rad] of a robot at a pose (3,) that bring points (n, 2) before a scanner, (m,).

        Of the points that none looks at, or only with the outermost `slack` [rad] of what it sees:
        all the way until one faces them.
        """
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        x, y = points[:, 0, None] - pose[0], points[:, 1, None] - pose[1]
        rows = self._rows
        ahead, aside = cos * x + sin * y - rows[:, 0], cos * y - sin * x - rows[:, 1]
        off = wrap(np.arctan2(aside, ahead) - rows[:, 2])
        beyond = np.abs(off) - np.maximum(rows[:, 3] - slack, 0.5 * rows[:, 3])
        nearest = beyond.argmin(axis=1)
        each = np.arange(len(points))
        found: Array = off[each, nearest][beyond[each, nearest] > 0.0]
        return found


class Rays:
    """A scan in the world: where its hits lie, and what its beams passed through.

    `scan`: seen from the robot. `poses`: where the robot was when it was taken: (3,), or (B, 3)
    where beams are of different ages. `cell`: side of the cells that are looked at.
    """

    def __init__(self, scan: LaserScan, poses: Array, cell: float) -> None:
        one = poses.ndim == 1
        cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        mount_x, mount_y, _ = scan.mount

        def placed(x: Array | float, y: Array | float) -> tuple[Array, Array]:
            return poses[..., 0] + cos * x - sin * y, poses[..., 1] + sin * x + cos * y

        reach, hits, step = scan.reach, scan.hits, abs(scan.angle_increment)
        x, y = placed(scan.ends[:, 0], scan.ends[:, 1])
        ranges, deviations = scan_library.averaged_ranges(reach, hits, step, scan.noise, 0.5 * cell)
        along = beams(*scan.layout)[1].T
        surface = placed(ranges * along[0] + mount_x, ranges * along[1] + mount_y)
        self.hits = np.stack(surface, axis=1)[hits]
        """(M, 2) what was hit."""
        self.deviations = deviations[hits]
        """(M,) standard deviations of their distances from the scanner."""
        self.origin = np.array(placed(mount_x, mount_y)).reshape(2, -1)[:, -1]
        """(2,) the scanner; at the time of the last beam."""
        self.low = np.minimum((x.min(), y.min()), self.origin) - cell
        """(2,) corner of the area that no beam has left ..."""
        self.high = np.maximum((x.max(), y.max()), self.origin) + cell
        """... and the opposite one."""
        if one:
            # beams of one moment lie in the robot's frame as those of the scan before
            self.turn = float(cos), float(sin)
            nearest, aside = _nearest_beams_of(scan.layout)
        else:
            self.turn = 1.0, 0.0
            x, y = x - self.origin[0], y - self.origin[1]
            reach = np.where(scan.unknown, 0.0, np.hypot(x, y))
            # if nothing is known of a beam's end, something is of its direction
            directions = np.where(scan.unknown, poses[:, 2] + scan.directions, np.arctan2(y, x))
            nearest, aside = _nearest_beams(directions)
        failed = np.isnan(scan.ranges) & counted(scan.layout, scan.ignore)
        # beams that fail by chance fail alone
        some = (failed[1:-1] & failed[:-2] & failed[2:]).any()
        self.vain = failed.take(nearest) if some else None
        """(2048,) numbered directions in which beams measure nothing, near or far; None: no three
        neighbours fail."""
        self.farthest = float(reach.max())
        """Longest ray."""
        # only so far does the nearest beam pass through a cell in a direction beside it
        within = np.minimum(reach.take(nearest), 0.5 * cell / np.maximum(aside, NOTHING))
        self.squares = np.empty(DIRECTIONS + 1, dtype=np.float32)
        """(2049,) square of how far rays passed in each direction, numbered by `kernels.scan_map`
        in a frame whose heading has the cosine and sine `turn`."""
        self.squares[:-1] = within * within
        self.squares[-1] = self.squares[0]


def _middles() -> Array:
    """Angles (DIRECTIONS,) of the middles of the numbered directions [rad], from -pi upwards."""
    share = (np.arange(DIRECTIONS) + 0.5) * (4.0 / DIRECTIONS) - 2.0
    along = 1.0 - np.abs(share)
    found: Array = np.arctan2(np.copysign(1.0 - np.abs(along), share), along)
    return found


MIDDLES = _middles()


def _nearest_beams(directions: Array) -> tuple[NDArray[np.intp], Array]:
    """For each numbered direction the nearest of beams (B,), and how far aside that one points."""
    directions = wrap(directions)
    order = np.argsort(directions)
    known = directions[order]
    after = np.searchsorted(known, MIDDLES)
    first, second = (after - 1) % len(known), after % len(known)
    aside = [np.abs(wrap(known[i] - MIDDLES)) for i in (first, second)]
    # what lies in the middle of two beams, but for rounding, goes to the first
    nearer = aside[0] <= aside[1] + EQUAL
    nearest: NDArray[np.intp] = order[np.where(nearer, first, second)]
    return nearest, np.where(nearer, *aside)


@lru_cache(maxsize=16)
def _nearest_beams_of(layout: Layout) -> tuple[NDArray[np.intp], Array]:
    """The same of a scanner whose beams are of one moment, in the robot's frame."""
    return _nearest_beams(beams(*layout)[0])
