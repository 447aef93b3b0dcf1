"""The rays of a scan from one point: how far each direction was seen to be clear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.obstacles.scan import LaserScan
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

DIRECTIONS = 2048
"""Directions that are told apart all around: the beams of the finest scanner that is usual."""


class Rays:
    """A scan in the world: where its hits lie, and what its beams passed through.

    Parameters
    ----------
    scan : LaserScan
        In metres.
    poses : ndarray
        Where the robot was when it was taken: (3,), or (B, 3) where beams are of different ages;
        in the robot's units.
    unit : float
        Metres of one of the robot's units.
    """

    def __init__(self, scan: LaserScan, poses: Array, unit: float) -> None:
        cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        ends, mount = scan.ends / unit, np.array(scan.mount[:2]) / unit

        def placed(x: Array | float, y: Array | float) -> Array:
            return np.stack(
                [poses[..., 0] + cos * x - sin * y, poses[..., 1] + sin * x + cos * y], axis=-1
            )

        ends = placed(ends[:, 0], ends[:, 1])
        self.origin = placed(*mount.tolist()).reshape(-1, 2)[-1]
        """(2,) the scanner; at the time of the last beam."""
        self.hits = ends[scan.hits]
        """(M, 2) what was hit."""
        self.noise = scan.noise / unit
        """Standard deviation of a range."""
        away = ends - self.origin
        if scan.time_increment:
            directions = np.arctan2(away[:, 1], away[:, 0])
            reach = np.where(scan.unknown, 0.0, np.hypot(away[:, 0], away[:, 1]))
        else:
            directions = scan.directions + poses[..., 2]
            reach = scan.reach / unit
        self.farthest = float(reach.max())
        """Longest ray."""
        order = np.argsort(wrap(directions))
        self._directions, self._reach = wrap(directions)[order], reach[order]
        self._table()

    def _table(self) -> None:
        """For each direction the reach of the nearest beam, and how far aside that one points."""
        wanted = (np.arange(DIRECTIONS) + 0.5) * (2.0 * np.pi / DIRECTIONS) - np.pi
        known = self._directions
        after = np.searchsorted(known, wanted)
        first, second = (after - 1) % len(known), after % len(known)
        aside = [np.abs(wrap(known[i] - wanted)) for i in (first, second)]
        nearer = aside[0] <= aside[1]
        self._clear = self._reach[np.where(nearer, first, second)]
        self._aside = np.where(nearer, aside[0], aside[1])

    def passed(self, x: Array, y: Array, cell: float) -> NDArray[np.bool_]:
        """Whether rays passed through the middles of cells, of a side, at x and y that broadcast.

        The nearest ray counts, where it passes through the cell at all.
        """
        away_x, away_y = x - self.origin[0], y - self.origin[1]
        distance = np.sqrt(away_x * away_x + away_y * away_y)
        direction = np.arctan2(away_y, away_x)
        direction += np.pi
        direction *= DIRECTIONS / (2.0 * np.pi)
        number = np.minimum(direction.astype(np.intp), DIRECTIONS - 1)
        passed: NDArray[np.bool_] = self._clear.take(number) >= distance
        distance *= self._aside.take(number)
        passed &= distance <= 0.5 * cell
        return passed
