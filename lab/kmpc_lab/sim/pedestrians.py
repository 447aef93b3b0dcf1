"""Pedestrians that walk about an area and ignore the robot: circles that do not yield."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.geometry import exact_arc
from kmpc_lite.types import Array


@dataclass(frozen=True)
class Walks:
    """How people walk.

    `count`: people. `turning`: whether they walk arcs, each for a few seconds, instead of straight
    to one place after the other. `slowest`, `fastest`: their speeds are uniform between these
    [m/s]. `radius`: of each [m]. `side`: they walk within a square about the origin of this side
    [m]. `start_distance`: least distance from the robot, edge to edge, at which they begin [m].
    """

    count: int
    turning: bool = False
    slowest: float = 0.3
    fastest: float = 1.0
    radius: float = 0.25
    side: float = 6.0
    start_distance: float = 1.5

    LEG = (1.0, 3.0)  # how long an arc is walked [s]
    TURN_RATE = 0.6  # turn rates of arcs are uniform up to this in either direction [rad/s]
    NEAR = 0.3  # how near to its place somebody chooses another one [m]


class Pedestrians:
    """People on their way; they never stop.

    `walks`: how they walk. `seed`: of all that is drawn. `away_from`: where the robot is when they
    begin (2,).
    """

    def __init__(self, walks: Walks, seed: int, away_from: Array) -> None:
        self.walks = walks
        self._random = random = np.random.default_rng([seed, 3])
        half, self.poses = 0.5 * walks.side, np.empty((walks.count, 3))
        for pose in self.poses:
            pose[:] = random.uniform((-half, -half, -math.pi), (half, half, math.pi))
            while np.hypot(*(pose[:2] - away_from)) < walks.start_distance + 2 * walks.radius:
                pose[:2] = random.uniform(-half, half, 2)
        self.speeds = random.uniform(walks.slowest, walks.fastest, walks.count)
        self._rates, self._left = np.zeros(walks.count), np.zeros(walks.count)
        self._places = self.poses[:, :2].copy()

    @property
    def circles(self) -> Array:
        """Rows x, y, radius, vx, vy (M, 5) of now."""
        heading = self.poses[:, 2]
        velocity = self.speeds[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        radii = np.full((len(heading), 1), self.walks.radius)
        return np.hstack([self.poses[:, :2], radii, velocity])

    def walk(self, dt: float, looks: int) -> Array:
        """Walk on for a period; give the places (looks, M, 2) on the way, without the first."""
        for i in range(self.walks.count):
            if self.walks.turning:
                self._choose_arc(i, dt)
            else:
                self._choose_place(i)
        times = dt * np.arange(1, looks + 1)[:, None] / looks
        path = exact_arc(self.poses, self.speeds, self._rates, times)
        self.poses = path[-1].copy()
        self.poses[:, 2] = np.remainder(self.poses[:, 2] + math.pi, math.tau) - math.pi
        places: Array = path[..., :2]
        return places

    def _choose_place(self, i: int) -> None:
        """Walk straight to a place, then to the next."""
        half = 0.5 * self.walks.side
        while np.hypot(*(self._places[i] - self.poses[i, :2])) < Walks.NEAR:
            self._places[i] = self._random.uniform(-half, half, 2)
        away = self._places[i] - self.poses[i, :2]
        self.poses[i, 2] = math.atan2(away[1], away[0])

    def _choose_arc(self, i: int, dt: float) -> None:
        """Walk an arc for a while; whoever leaves the area turns towards its middle."""
        self._left[i] -= dt
        if self._left[i] <= 0.0:
            self._left[i] = self._random.uniform(*Walks.LEG)
            self._rates[i] = self._random.uniform(-Walks.TURN_RATE, Walks.TURN_RATE)
        x, y, heading = self.poses[i].tolist()
        if max(abs(x), abs(y)) > 0.5 * self.walks.side:
            off = math.remainder(math.atan2(-y, -x) - heading, math.tau)
            self._rates[i] = math.copysign(2.0 * Walks.TURN_RATE, off) if abs(off) > 0.3 else 0.0
