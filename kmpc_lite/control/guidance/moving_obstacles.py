"""Circles that move: where the robot will meet them, and whether it must slow down or make room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.guidance.timed_path import TimedPath
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Solids

LOOK_AHEAD = 4.0
"""How far obstacles are moved on at constant velocity [s]."""
STEP = 0.2
"""Between the moments that are looked at [s]."""
SPARE = 0.12
"""Distance beyond the margin within which a moving circle is in the way [m]: it is soon lost to a
robot that lags."""
DETOUR = 0.06
"""Part of it that a way keeps [m]."""
LONG = 3.0
"""How much farther an arc that makes room is looked along, where there is a choice."""
PACES = np.array([0.6, 0.3, 0.0])
"""Shares of the speed that are tried where the full one is not clear; the first one that is, is
driven."""
ESCAPES = np.array(
    [
        (v, omega, end)
        for end in (1.0, 2.0, 4.0)
        for v in (0.0, 0.5, -0.5, 1.0, -1.0)
        for omega in (0.0, 1.0, -1.0)
    ]
)
"""Shares of speed and rate of turn, and time [s], of the arcs on which room is made; the robot
stops at their ends."""
BARRED, TOUCHING = 100.0, 1e-3
"""What an arc into a solid costs, in metres of room, and how deep it may lead [m]."""
FAITH = 0.03
"""How much more room another arc must promise than the one begun [m]."""


class MovingObstacles:
    """Circles at constant velocity, as they are now.

    Parameters
    ----------
    circles : ndarray
        (M, 5) rows x, y, radius, vx, vy.
    keep : float
        Distance of the robot's centre to the circles' edges [m].
    speed : ndarray
        At which the robot drives and turns [m/s, rad/s], (2,).
    solids : Solids, optional
        What else is there, at rest.
    """

    def __init__(
        self, circles: Array, keep: float, speed: Array, solids: Solids | None = None
    ) -> None:
        self.all, self._solids = circles, solids
        self._moving = circles[circles[:, 3:].any(axis=1)]
        self._keep, self._speed = keep, speed
        self._times = np.arange(0.0, LOOK_AHEAD + 1e-9, STEP)

    def where_met(self, pose: Array) -> Array:
        """All circles (M, 5), the moving ones where a robot at a pose (3,) would meet them, and larger by a part of `SPARE`."""
        met = self.all.copy()
        time = np.zeros(len(met))
        # how far away it is when the robot gets there, to two rounds
        for _ in range(2):
            away = self.all[:, :2] + time[:, None] * self.all[:, 3:] - pose[:2]
            gap = np.maximum(np.hypot(away[:, 0], away[:, 1]) - self.all[:, 2] - self._keep, 0.0)
            time = np.minimum(gap / self._speed[0], LOOK_AHEAD)
        met[:, :2] += time[:, None] * self.all[:, 3:]
        met[:, 2] += DETOUR * self.all[:, 3:].any(axis=1)
        return met

    def _room(self, positions: Array, circles: Array, times: Array | None = None) -> Array:
        """Least distance (...) to spare from circles (M, 5), of positions (..., T, 2) at the moments that are looked at."""
        times = self._times if times is None else times
        away = positions[..., None, :] - circles[:, :2] - times[:, None, None] * circles[:, 3:]
        gaps: Array = np.sqrt(np.einsum("...i,...i->...", away, away)) - circles[:, 2] - self._keep
        room: Array = gaps.min(axis=(-2, -1))
        return room

    def blocks(self, path: TimedPath, place: float) -> bool:
        """Whether a circle will be where the robot then is."""
        return bool(self._room(path.at(place + self._times)[:, :2], self._moving) < 0.0)

    def pace(self, path: TimedPath, place: float) -> float | None:
        """Share of the speed at which the robot on its way keeps clear, none: at no pace."""
        if self._room(path.at(place + self._times)[:, :2], self._moving) >= SPARE:
            return 1.0
        slower = PACES[:, None] * self._times
        positions = path.at((place + slower).ravel())[:, :2].reshape(*slower.shape, 2)
        clear = self._room(positions, self._moving) >= SPARE
        return float(PACES[np.argmax(clear)]) if clear.any() else None

    def leaves_alone(self, pose: Array) -> bool:
        """Whether a robot that stays at a pose (3,) is not touched."""
        return bool(
            self._room(np.broadcast_to(pose[:2], (len(self._times), 2)), self._moving) >= SPARE
        )

    def escape(self, pose: Array, last: int, times: Array) -> tuple[int, Array]:
        """Arc on which the robot gets the most room: its number and its poses (n, 3) at times (n,) [s].

        The first one that is clear for long is taken, since the first ones move least; a robot that
        only makes room for now is pushed along by what comes after it. Else the first that is clear
        for now; where none is, the one begun, number `last` (-1: none), is kept unless another one
        promises `FAITH` more.
        """
        for ahead in (self._times * LONG, self._times):
            room = self._room_on_arcs(pose, ahead)
            clear = room >= SPARE
            if clear.any():
                best = int(np.argmax(clear))
                break
        else:
            if last >= 0:
                room[last] += FAITH
            best = int(np.argmax(room))
        arc: Array = self._arcs(pose, times)[best]
        return best, arc

    def _room_on_arcs(self, pose: Array, times: Array) -> Array:
        """Least distance (E,) to spare on all arcs from a pose (3,), at times (T,) [s]."""
        positions = self._arcs(pose, times)[..., :2]
        room = self._room(positions, self.all, times)
        if self._solids is not None:
            near = self._solids.near(pose[:2], LOOK_AHEAD * float(self._speed[0]) + self._keep)
            gaps = near.least(positions.reshape(-1, 2)).reshape(room.shape[0], -1)
            # what stands still needs no spare room, but no circle is a reason to drive into it
            room[gaps.min(axis=1) < min(self._keep, float(gaps[0, 0])) - TOUCHING] -= BARRED
        return room

    def _arcs(self, pose: Array, times: Array) -> Array:
        """Poses (E, n, 3) on all arcs from a pose (3,)."""
        v, omega = (ESCAPES[:, :2] * self._speed).T[..., None]
        times = np.minimum(times, ESCAPES[:, 2:])
        turn = omega * times
        # chord of an arc: v t sinc(turn / 2), along the mean heading
        chord = v * times * np.sinc(turn / (2 * np.pi))
        along = pose[2] + 0.5 * turn
        return np.stack(
            [pose[0] + chord * np.cos(along), pose[1] + chord * np.sin(along), pose[2] + turn],
            axis=-1,
        )
