"""A dynamic window over what was seen: what a user writes in a day, to compare with.

Speeds that the robot can reach soon are driven ahead as arcs; those that stop clear of what was
seen compete by the way that is left from where they lead.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from kmpc_lab.studies.pursuit import cost_to_go
from kmpc_lite.types import Array

CELL = 0.05  # side of a cell [m]
FORGETS, SURE = 0.97, 1.5
"""Share of what was seen that is left after a period, and how many hits make a cell occupied."""
AHEAD, STEPS = 0.9, 9  # how long arcs are driven ahead [s], and in how many steps
WINDOW = 0.25  # how far ahead the speeds of the window lie [s]
RENEWS = 4  # periods after which the way that is left is worked out anew
NOSE = 0.35
"""Distance ahead of the robot's middle whose way counts, too, so that it faces its way [m]."""
NEAR, SHY = 0.12, 0.6
"""Clearance below which an arc costs more [m], and how much, in metres of way for each."""
BACKS = 0.4  # fastest speed backwards [m/s]: out of a dead end
REACTS = 0.15  # time until the robot brakes [s]


class Dwa:
    """Drives by a dynamic window.

    `bounds`: xmin, ymin, xmax, ymax of its area [m]. `size`: length and width of the robot [m].
    `fastest`, `ramps`: speed and turn rate [m/s, rad/s], and how fast they change [m/s^2, rad/s^2].
    `dt`: period [s].
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        size: tuple[float, float],
        fastest: tuple[float, float],
        ramps: tuple[float, float],
        dt: float,
    ) -> None:
        self._low = np.array(bounds[:2])
        shape = np.ceil((np.array(bounds[2:]) - bounds[:2]) / CELL).astype(int)
        self._seen = np.zeros(shape[::-1])
        # three circles along the middle cover the outline
        third, half = size[0] / 3.0, 0.5 * size[1]
        self._discs, self._radius = third * np.array([-1.0, 0.0, 1.0]), math.hypot(third / 2, half)
        self._turns = math.hypot(0.5 * size[0], half)
        self._fastest, self._ramps, self._dt = np.array(fastest), np.array(ramps), dt
        self._speeds, self._k = np.zeros(2), 0
        self._left = self._away = self._seen

    def command(self, pose: Array, goal: Array, ends: Array) -> Array:
        """Command (2,) from a pose (3,), after a scan hit points (M, 2) in the world."""
        self._look(ends, goal)
        reach = self._ramps * WINDOW
        low = np.maximum(self._speeds - reach, [-BACKS, -self._fastest[1]])
        high = np.minimum(self._speeds + reach, self._fastest)
        v, turn = (
            a.ravel() for a in np.meshgrid(*map(np.linspace, low, high, (7, 15)), indexing="ij")
        )
        times = AHEAD / STEPS * np.arange(1, STEPS + 1)[:, None]
        poses = _arcs(pose, v, turn, times)
        gaps = self._gaps(poses)
        # what is driven until it stands must be clear; beyond it, it is driven as far as it is
        stops = times <= REACTS + np.abs(v) / self._ramps[0] + AHEAD / STEPS
        admissible = np.where(stops, gaps, np.inf).min(axis=0) > 0.0
        if not admissible.any():
            return self._turn_on_the_spot(pose, goal)
        clear = np.logical_and.accumulate(gaps > 0.0, axis=0)
        last = np.maximum(clear.sum(axis=0) - 1, 0)
        end = poses[last, np.arange(len(v))]
        nose = end[:, :2] + NOSE * np.stack([np.cos(end[:, 2]), np.sin(end[:, 2])], axis=1)
        left = self._at(self._left, end[:, :2]) + 0.5 * self._at(self._left, nose)
        shy = SHY * np.maximum(NEAR - np.where(clear, gaps, np.inf).min(axis=0), 0.0) / NEAR
        cost = np.where(admissible, left + shy - 0.02 * v, np.inf)
        best = int(cost.argmin())
        return self._go(np.array([v[best], turn[best]]))

    def _go(self, wanted: Array) -> Array:
        most = self._ramps * self._dt
        self._speeds = self._speeds + np.clip(wanted - self._speeds, -most, most)
        return self._speeds.copy()

    def _turn_on_the_spot(self, pose: Array, goal: Array) -> Array:
        """Brake; turn to where the way that is left is shortest."""
        around = pose[2] + np.linspace(-math.pi, math.pi, 25)[1:]
        places = pose[:2] + 0.5 * np.stack([np.cos(around), np.sin(around)], axis=1)
        best = around[int(self._at(self._left, places).argmin())]
        turn = 2.0 * math.remainder(best - pose[2], math.tau)
        if self._at(self._away, pose[None, :2])[0] < self._turns:
            return self._go(np.array([-0.2, 0.5 * turn]))
        return self._go(np.array([0.0, np.clip(turn, -self._fastest[1], self._fastest[1])]))

    def _look(self, ends: Array, goal: Array) -> None:
        """Mark hits, forget old ones, and work out the way that is left now and then."""
        self._seen *= FORGETS
        np.add.at(self._seen, self._cells(ends), 1.0)
        np.minimum(self._seen, 1.0 / (1.0 - FORGETS), out=self._seen)
        hits = self._seen > SURE
        self._away = ndimage.distance_transform_edt(~hits) * CELL if hits.any() else hits + 9.0
        if self._k % RENEWS == 0:
            row, column = self._cells(goal[None, :2])
            free = self._away >= self._radius + CELL
            left = CELL * cost_to_go(free, (int(row[0]), int(column[0])))
            # too near to something: on to the nearest free place, at a price
            near = ndimage.distance_transform_edt(~np.isfinite(left), return_indices=True)
            self._left = left[tuple(near[1])] + 5.0 * CELL * near[0]
        self._k += 1

    def _cells(self, points: Array) -> tuple[Array, Array]:
        place = np.floor((points - self._low) / CELL).astype(int)
        high = np.array(self._seen.shape[::-1]) - 1
        column, row = np.clip(place, 0, high).T
        return row, column

    def _gaps(self, poses: Array) -> Array:
        """Distances of the outline from hits (S, N) at poses (S, N, 3) [m]."""
        ahead = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], axis=-1)
        middles = poses[..., None, :2] + self._discs[:, None] * ahead[..., None, :]
        gaps: Array = self._at(self._away, middles).min(axis=-1) - self._radius - 0.5 * CELL
        return gaps

    def _at(self, field: Array, points: Array) -> Array:
        """Values of a field at points (..., 2), between the middles of its cells."""
        place = (points - self._low) / CELL - 0.5
        found: Array = ndimage.map_coordinates(
            field, np.moveaxis(place[..., ::-1], -1, 0), order=1, mode="nearest"
        )
        return found


def _arcs(pose: Array, v: Array, turn: Array, times: Array) -> Array:
    """Poses (S, N, 3) on arcs of speeds and turn rates (N,) at times (S, 1)."""
    turned = turn * times
    middle = pose[2] + 0.5 * turned
    chord = v * times * np.sinc(0.5 * turned / math.pi)
    x, y = pose[0] + chord * np.cos(middle), pose[1] + chord * np.sin(middle)
    return np.stack([x, y, pose[2] + turned], axis=-1)
