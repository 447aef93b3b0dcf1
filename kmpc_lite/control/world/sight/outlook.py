"""Where scanners look: from which place on the robot, and in which directions."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from kmpc_lite.control.world.scan import LaserScan, Layout, Sector, beams
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

BEYOND = 1e-6
"""How far beyond its end a sector is looked at, to tell whether another one goes on there [rad]."""


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
