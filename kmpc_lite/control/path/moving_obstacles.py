"""Circles that move: whether the robot will meet them, and must slow down or make room for them."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.records import VELOCITY, distances
from kmpc_lite.control.options import MovingObstacleOptions
from kmpc_lite.geometry import exact_arc
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.planner import TimedPath
    from kmpc_lite.control.world.solids import Solids

ROUNDING = 1e-9  # time that belongs to the look-ahead [s]
LOOK_STEP = 0.2  # time between two moments at which distances are looked at [s]
PATH_SHARE = 0.5  # share of the clearance that paths keep
SWITCH_SHARE = 0.25
"""The robot leaves the arc that it is on for another one only if that promises this much more
clearance, as a share of it."""
TOUCH_SHARE = 1 / 120
"""How far an evasive arc may lead into the margin of a solid, or out of the area, as a share of the
clearance."""
LONG_LOOK = 3.0
"""Evasive arcs are first looked at this many times as far ahead, and those that are clear for so
long are preferred: on others a circle that follows would push the robot along."""
ARC_SPEEDS = (0.0, 0.5, -0.5, 1.0, -1.0)
"""Speeds of the evasive arcs, as shares of the fastest; the first arcs are preferred, since they
move least."""
ARC_TURNS = (0.0, 1.0, -1.0)  # their rates of turn, as shares of the fastest
ARC_TIMES = (1.0, 2.0, 4.0)  # how long the robot drives on them before it stops [s]


class MovingObstacleTable:
    """What follows from the options: moments that are looked at, scales and arcs that are tried.

    `options`: in metres.
    """

    def __init__(self, options: MovingObstacleOptions) -> None:
        self.options = options
        self.times = np.arange(0.0, options.look_ahead + ROUNDING, LOOK_STEP)  # (T,) from now [s]
        self.scales = np.array(options.speed_scales)  # (S,) shares of the speed
        order = product(ARC_TIMES, ARC_SPEEDS, ARC_TURNS)
        self.arcs = np.array([(v, omega, end) for end, v, omega in order])
        """(E, 3) shares of speed and rate of turn, and when the arc ends [s]."""


class MovingObstacles:
    """Circles at constant velocity, as they are now.

    `circles`: (M, 7) as of `kernels.clearance`; those at rest belong to it. `inflation`: distance
    that the robot's centre must keep from the circles' edges [m]. `speed`: at which the robot
    drives and turns [m/s, rad/s], (2,). `table`: of the options. `solids`: what else is there, at
    rest. `area`: least and largest x, y of the robot's centre (2, 2) [m]: beyond it there is no
    room.
    """

    def __init__(
        self,
        circles: Array,
        inflation: float,
        speed: Array,
        table: MovingObstacleTable,
        solids: Solids | None = None,
        area: Array | None = None,
    ) -> None:
        self._all, self._solids, self._area = circles, solids, area
        self._moving = circles[circles[:, VELOCITY].any(axis=1)]
        self._inflation, self._speed = inflation, speed
        self._table, self._times, self._options = table, table.times, table.options

    def stays(self, waited: float) -> bool:
        """Whether a robot has stood so long [s] that what it lets pass is not about to pass."""
        return waited > self._options.look_ahead

    def where_met(self, pose: Array, waited: float = 0.0) -> Array:
        """Circles (M, 7) where a robot at a pose (3,) meets them if it drives there.

        Those that move are larger by the clearance that paths keep from them. Where the robot has
        stood for them too long [s], by that at which they are not in its way, and by how far they
        come while it drives past.
        """
        met, velocity = self._all.copy(), self._all[:, VELOCITY]
        time = np.zeros(len(met))
        # how far away it is when the robot gets there, to two rounds
        for _ in range(2):
            away = self._all[:, :2] + time[:, None] * velocity - pose[:2]
            distance = np.hypot(away[:, 0], away[:, 1]) - self._all[:, 2] - self._inflation
            time = np.minimum(np.maximum(distance, 0.0) / self._speed[0], self._options.look_ahead)
        met[:, :2] += time[:, None] * velocity
        if self.stays(waited):
            kept = self._options.clearance * velocity.any(axis=1)
            kept += (self._options.look_ahead - time) * np.hypot(velocity[:, 0], velocity[:, 1])
        else:
            kept = PATH_SHARE * self._options.clearance * velocity.any(axis=1)
        met[:, 2] += kept
        return met

    def blocks(self, path: TimedPath, place: float, waited: float = 0.0) -> bool:
        """Whether a circle will be where the robot then is on its path, from its place [s] on.

        Or whether the robot has stood there for too long [s].
        """
        if self.stays(waited):
            return True
        positions = path.at(place + self._times)[:, :2]
        return bool(self._from_moving(positions) < 0.0)

    def speed_scale(self, path: TimedPath, place: float) -> float | None:
        """Share of the speed at which the robot on its path keeps clear; none if no share does."""
        wanted = self._options.clearance
        positions = path.at(place + self._times)[:, :2]
        if self._from_moving(positions) >= wanted:
            return 1.0
        scales = self._table.scales
        slower = scales[:, None] * self._times
        positions = path.at((place + slower).ravel())[:, :2].reshape(*slower.shape, 2)
        clear = self._from_moving(positions) >= wanted
        return float(scales[np.argmax(clear)]) if clear.any() else None

    def spares(self, pose: Array) -> bool:
        """Whether a robot that stays at a pose (3,) is passed at a distance."""
        stays = np.broadcast_to(pose[:2], (len(self._times), 2))
        clearance = self._from_moving(stays)
        return bool(clearance >= self._options.clearance)

    def evasive_arc(self, pose: Array, begun: int, times: Array) -> tuple[int, Array]:
        """Pick the arc on which the robot makes room.

        The first one that is clear for long is taken; else the first that is clear for now. Where
        none is, the one with the most clearance; the arc begun is kept unless another promises more
        by `switch_clearance`.

        `pose`: the robot's pose (3,). `begun`: number of the arc that it is on; -1 for none.
        `times`: times (n,) at which poses are wanted [s]. Returns `number`: of the arc; `poses`:
        (n, 3) on it.
        """
        for ahead in (self._times * LONG_LOOK, self._times):
            clearance = self._clearance_on_arcs(pose, ahead)
            clear = clearance >= self._options.clearance
            if clear.any():
                best = int(np.argmax(clear))
                break
        else:
            if begun >= 0:
                clearance[begun] += SWITCH_SHARE * self._options.clearance
            best = int(np.argmax(clearance))
        arc: Array = self._arcs(pose, times)[best]
        return best, arc

    def _from_moving(self, positions: Array) -> Array:
        """Least clearance (...) of positions (..., T, 2) from what moves [m]."""
        return self._clearance(positions, self._moving, self._times)

    def _clearance(self, positions: Array, circles: Array, times: Array) -> Array:
        """Least clearance (...) from circles (M, 7), of positions (..., T, 2) at times (T,) [m]."""
        *shape, count, _ = positions.shape
        at = np.broadcast_to(times, (*shape, count)).reshape(-1)
        gaps = distances(circles, positions.reshape(-1, 2), at)
        least: Array = gaps.reshape(*shape, -1).min(axis=-1) - self._inflation
        return least

    def _clearance_on_arcs(self, pose: Array, times: Array) -> Array:
        """Least clearance (E,) on all arcs from a pose (3,).

        Arcs into solids and out of the area come last.
        """
        positions = self._arcs(pose, times)[..., :2]
        clearance = self._clearance(positions, self._all, times)
        last = np.ptp(clearance) + np.abs(clearance).max()
        if self._area is not None:
            outside = np.maximum(self._area[0] - positions, positions - self._area[1]).max(axis=2)
            # a robot that stands outside need not go farther
            allowed = max(float(outside[0, 0]), 0.0) + TOUCH_SHARE * self._options.clearance
            clearance[outside.max(axis=1) > allowed] -= last
        if self._solids is None:
            return clearance
        longest = float(self._table.arcs[:, 2].max())
        reach = longest * float(self._speed[0]) + self._inflation
        near = self._solids.within(pose[:2], reach)
        distances = near.least(positions.reshape(-1, 2)).reshape(len(clearance), -1)
        # what stands still needs no more than its margin; no circle is a reason to drive into it
        allowed = (
            min(self._inflation, float(distances[0, 0])) - TOUCH_SHARE * self._options.clearance
        )
        clearance[distances.min(axis=1) < allowed] -= last
        return clearance

    def _arcs(self, pose: Array, times: Array) -> Array:
        """Poses (E, n, 3) on all arcs from a pose (3,)."""
        v, omega = (self._table.arcs[:, :2] * self._speed).T[..., None]
        return exact_arc(pose, v, omega, np.minimum(times, self._table.arcs[:, 2:]))
