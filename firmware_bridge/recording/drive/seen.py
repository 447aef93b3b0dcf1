"""What a scan showed, for files and pictures: what counted of it, its hits, what it saw to be free.

Pages shade what no beam has passed
lately: that is unknown, occluded or out of reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lite.control.options import USUAL_OBSTACLES
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.geometry import rotate
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.controller import Controller

NOTHING, CLEAR = -1.0, -2.0
"""Ranges that no sensor measures: a beam that tells nothing, and one that met nothing."""
BEAMS = 120  # hits of a scan that a report shows at the most
CORNERS = 90  # of the outline of what a scan saw to be free
ALL_AROUND = 0.99 * 2.0 * np.pi  # field of view without a gap [rad]
STEP = 0.005  # to which the corners are rounded [m]


def told_ranges(scan: LaserScan) -> Array:
    """Ranges (B,) of a scan as finite numbers [m]; `NOTHING` and `CLEAR` stand in for others."""
    told: Array = np.where(scan.hits, scan.ranges, np.where(scan.clear, CLEAR, NOTHING))
    return told


def ranges_of(told: Array) -> Array:
    """Ranges as `LaserScan` takes them, of what `told_ranges` gave."""
    ranges: Array = np.where(told == CLEAR, np.inf, np.where(told < 0.0, np.nan, told))
    return ranges


def scan_among(obstacles: Any) -> LaserScan | None:
    """The first scan among obstacles as `Controller.step` takes them."""
    return next((obstacle for obstacle in obstacles if isinstance(obstacle, LaserScan)), None)


def counted(controller: Controller, scan: LaserScan) -> LaserScan:
    """A scan as a controller has counted and placed it in the step that it has just made.

    Hits on the robot itself tell nothing. A scan that is older than the pose was seen from where
    the robot was then, which its mount says; of beams that are of different ages, the middle one
    counts.
    """
    problem, here = controller.problem, controller.state.seen
    own = problem.robot_radius
    if problem.footprint is not None:
        own = problem.footprint.inner_radius
    scan = scan.with_self_radius(own)
    age = scan.age + 0.5 * scan.time_increment * (len(scan) - 1)
    if here is None or not age:
        return scan
    scale = controller.scale
    now, then = here.poses_at(np.array([0.0, age / scale.time]))
    ahead, left, heading = scan.mount
    x, y = rotate(ahead, left, float(then[2]))
    way = (then[:2] - now[:2]) * scale.length
    x, y = rotate(float(way[0]) + x, float(way[1]) + y, -float(now[2]))
    return LaserScan(
        ranges_of(told_ranges(scan)),
        scan.angle_min,
        scan.angle_increment,
        scan.range_max,
        mount=(x, y, heading + float(then[2] - now[2])),
        mirrored=scan.mirrored,
        noise=scan.noise,
        limits=replace(USUAL_OBSTACLES, scan_beams=len(scan)),
    )


def hits(scan: LaserScan, most: int = BEAMS) -> Array:
    """Places (B, 2) that a scan hit, in the robot's frame [m]; so many at the most.

    Examples
    --------
    >>> scan = LaserScan([1.0, np.inf, 0.1], 0.0, 0.5, range_max=5.0, range_min=0.2)
    >>> hits(scan).tolist()
    [[1.0, 0.0]]
    """
    points = scan.points
    found: Array = points[:: max(1, -(-len(points) // most))]
    return found


def outline(scan: LaserScan) -> Array:
    """Corners (`CORNERS` + 1, 2) round what a scan saw to be free, in the robot's frame [m].

    The first is the scanner, or the last once more where it sees all around. Neighbouring beams
    share a corner, at the distance of the shortest; those that tell nothing do not count beside
    others that do.

    Examples
    --------
    >>> scan = LaserScan(np.full(360, np.inf), -np.pi, np.pi / 180, range_max=4.0)
    >>> np.hypot(*outline(scan)[1:].T).round(6).max()
    np.float64(4.0)
    """
    count = len(scan)
    starts = np.arange(CORNERS) * count // CORNERS
    reach = np.where(scan.unknown, np.inf, scan.reach)
    shortest = np.minimum.reduceat(reach, starts)
    shortest[~np.isfinite(shortest)] = 0.0
    middle = np.append(starts[1:], count) - 1
    angles = 0.5 * (scan.directions[starts] + scan.directions[np.maximum(middle, starts)])
    ends = shortest[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    around = abs(scan.angle_increment) * count > ALL_AROUND
    first = ends[-1:] if around else np.zeros((1, 2))
    found: Array = np.vstack([first, ends]) + np.array(scan.mount[:2])
    return found
