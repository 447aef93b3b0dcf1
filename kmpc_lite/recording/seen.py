"""What a scan showed, for pictures: its hits, and the outline of what is free.

Pages shade what no beam has passed lately: that is unknown, occluded or out of reach.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kmpc_lite.control.obstacles.scan import LaserScan
from kmpc_lite.types import Array

BEAMS = 120
"""Hits of a scan that are shown at the most."""
CORNERS = 90
"""Of the outline of what a scan saw to be free."""
ALL_AROUND = 0.99 * 2.0 * np.pi
"""Field of view without a gap [rad]."""
STEP = 0.005
"""To which the corners are told [m]."""


def scan_among(obstacles: Any) -> LaserScan | None:
    """The first scan among obstacles as `Controller.step` takes them."""
    return next((obstacle for obstacle in obstacles if isinstance(obstacle, LaserScan)), None)


def hits(scan: LaserScan) -> Array:
    """Places (B, 2) that a scan hit, in the robot's frame [m]; at most `BEAMS`."""
    points = scan.points
    found: Array = points[:: max(1, -(-len(points) // BEAMS))]
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
