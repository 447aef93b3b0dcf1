"""The rays of a scan from one point: how far each direction was seen to be clear."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import scan_library
from kmpc_lite.control.kernels.scan_map import DIRECTIONS, NOTHING
from kmpc_lite.control.world.scan import LaserScan, Layout, beams, counted
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

EQUAL = 1e-9
"""Difference of two angles that is rounding [rad]."""


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
