"""Circles that move: where the robot will meet them, and whether it must slow down or make room."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.timed_path import TimedPath
from kmpc_lite.dictionary import Array

LOOK_AHEAD = 4.0
"""How far obstacles are moved on at constant velocity [s]."""
STEP = 0.2
"""Between the moments that are looked at [s]."""
SPARE = 0.05
"""Distance beyond the margin within which a moving circle is in the way [m]."""
PACES = np.array([0.6, 0.3, 0.0])
"""Shares of the speed that are tried where the full one is not clear; the first one that is, is driven."""


class MovingCircles:
    """Circles at constant velocity, known at one moment.

    Parameters
    ----------
    circles : ndarray
        (M, 5) rows x, y, radius, vx, vy; circles at rest are left out.
    keep : float
        Distance of the robot's centre to the circles' edges [m].
    speed : float
        At which the robot drives [m/s].
    """

    def __init__(self, circles: Array, keep: float, speed: float) -> None:
        self.all = circles
        self._moving = circles[circles[:, 3:].any(axis=1)]
        self._keep, self._speed = keep, speed
        self._times = np.arange(0.0, LOOK_AHEAD + 1e-9, STEP)

    def where_met(self, pose: Array) -> Array:
        """All circles (M, 5), the moving ones where a robot at a pose (3,) would meet them."""
        met = self.all.copy()
        time = np.zeros(len(met))
        # how far away it is when the robot gets there, to two rounds
        for _ in range(2):
            away = self.all[:, :2] + time[:, None] * self.all[:, 3:] - pose[:2]
            gap = np.maximum(np.hypot(away[:, 0], away[:, 1]) - self.all[:, 2] - self._keep, 0.0)
            time = np.minimum(gap / self._speed, LOOK_AHEAD)
        met[:, :2] += time[:, None] * self.all[:, 3:]
        return met

    def _gaps(self, positions: Array, times: Array) -> Array:
        """Distances (..., M) that positions (..., 2) at times (...) have to spare."""
        away = positions[..., None, :] - self._moving[:, :2] - times[..., None, None] * self._moving[:, 3:]
        gaps: Array = np.sqrt(np.einsum("...i,...i->...", away, away)) - self._moving[:, 2] - self._keep
        return gaps

    def blocks(self, path: TimedPath, place: float, age: float) -> bool:
        """Whether a circle will be where the robot then is; `age` [s] since the circles were seen."""
        positions = path.at(place + self._times)[:, :2]
        return bool((self._gaps(positions, age + self._times) < 0.0).any())

    def pace(self, path: TimedPath, place: float, age: float, times: Array) -> float:
        """Share of the speed at which the robot keeps clear over the coming times (n,) [s]."""
        gap = float(self._gaps(path.at(place + times)[:, :2], age + times).min())
        if gap >= SPARE:
            return 1.0
        slower = PACES[:, None] * times
        positions = path.at((place + slower).ravel())[:, :2].reshape(*slower.shape, 2)
        gaps = self._gaps(positions, np.broadcast_to(age + times, slower.shape)).min(axis=(1, 2))
        clear = gaps >= SPARE
        best = float(PACES[np.argmax(clear)]) if clear.any() else float(PACES[np.argmax(gaps)])
        return best if clear.any() or gaps.max() > gap else 1.0

    def leaves_alone(self, pose: Array, age: float) -> bool:
        """Whether a robot that stays at a pose (3,) is not touched."""
        return bool((self._gaps(np.broadcast_to(pose[:2], (len(self._times), 2)), age + self._times) >= SPARE).all())
