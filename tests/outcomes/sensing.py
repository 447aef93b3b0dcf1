"""How a controller gets to see obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes.plant import Array
from outcomes.setup import Moment


def known(moment: Moment) -> Any:
    """Everything, with its velocity."""
    rows = moment.scene.circles_at(moment.time)
    return [*(kl.Circle(*row) for row in rows.tolist()), *moment.scene.solids]


def rows_only(moment: Moment) -> Any:
    """All circles as an array."""
    return moment.scene.circles_at(moment.time)


def said_to_stand(moment: Moment) -> Any:
    """All circles, with velocity zero."""
    rows = moment.scene.circles_at(moment.time)
    rows[:, 3:] = 0.0
    return rows


@dataclass(frozen=True)
class NoisyRows:
    """Circles whose places are measured with noise and whose velocities are unknown."""

    noise: float = 0.01  # [m]

    def __call__(self, moment: Moment) -> Any:
        """Give the rows."""
        rows = said_to_stand(moment)
        rows[:, :2] += self.noise * moment.random.normal(size=(len(rows), 2))
        return rows


@dataclass(frozen=True)
class Within:
    """Circles within a reach of the robot's edge."""

    reach: float  # [m]

    def __call__(self, moment: Moment) -> Any:
        """Give the circles."""
        rows = moment.scene.circles_at(moment.time)
        gaps = np.hypot(*(rows[:, :2] - moment.pose[:2]).T) - rows[:, 2] - moment.radius
        return rows[gaps <= self.reach]


@dataclass
class Scanner:
    """A laser scanner, its mount, its noise and its faults."""

    reach: float = 4.0  # [m]
    beams: int = 360
    view: float = math.tau  # field of view about its own axis [rad]
    noise: float = 0.01  # [m]
    dropout: float = 0.01  # share of beams that come back as NaN
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    age: float = 0.0  # how old its scans are [s]
    turn_time: float = 0.0  # time from the first beam to the last [s]
    hangs: tuple[float, float] = (math.inf, math.inf)
    """From when until when it sends the same scan again [s]."""
    dies: tuple[float, float] = (math.inf, math.inf)  # from when until when all beams are NaN [s]
    masts: tuple[float, ...] = ()  # directions in which a mast of the robot is hit at 0.1 m [rad]
    glass: tuple[float, float] | None = None  # hits between these x [m] come back as NaN
    mirrored: bool = False

    def __post_init__(self) -> None:
        self._trail: list[tuple[float, Array]] = []
        self._last: Any = None

    def __call__(self, moment: Moment) -> Any:
        """One scan, in a list."""
        self._trail.append((moment.time, moment.pose))
        if self._last is not None and self.hangs[0] <= moment.time < self.hangs[1]:
            return [self._last]
        self._last = self._scan(moment)
        return [self._last]

    def _scan(self, moment: Moment) -> kl.LaserScan:
        full = self.view >= math.tau - 1e-9
        step = self.view / (self.beams if full else self.beams - 1)
        directions = -0.5 * self.view + step * np.arange(self.beams)
        late = self.age + self.turn_time * np.arange(self.beams - 1, -1, -1) / self.beams
        poses = self._poses(moment.time - late)
        ahead, left, heading = self.mount
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        origin = poses[:, :2] + np.stack([cos * ahead - sin * left, sin * ahead + cos * left], 1)
        world = moment.scene.world_at(moment.time - self.age)
        ranges = world.ranges(origin, poses[:, 2] + heading + directions)
        if self.glass is not None:
            x = origin[:, 0] + ranges * np.cos(poses[:, 2] + heading + directions)
            ranges = np.where((x > self.glass[0]) & (x < self.glass[1]), np.nan, ranges)
        ranges = ranges + self.noise * moment.random.normal(size=self.beams)
        ranges[ranges > self.reach] = np.inf
        for mast in self.masts:
            ranges[np.abs(np.remainder(directions - mast + math.pi, math.tau) - math.pi) < 0.1] = (
                0.1
            )
        ranges[moment.random.random(self.beams) < self.dropout] = np.nan
        if self.dies[0] <= moment.time < self.dies[1]:
            ranges[:] = np.nan
        begin, order = -0.5 * self.view, slice(None)
        if self.mirrored:
            order, begin = slice(None, None, -1), -directions[-1]
        return kl.LaserScan(
            ranges[order],
            begin,
            step,
            self.reach,
            0.05,
            self.mount,
            self.mirrored,
            noise=self.noise,
            age=self.age,
            time_increment=self.turn_time / self.beams,
        )

    def _poses(self, times: Array) -> Array:
        """Poses (B, 3) at times (B,) between the steps; before the first the robot stood."""
        at, poses = np.array([t for t, _ in self._trail]), np.array([p for _, p in self._trail])
        return np.stack([np.interp(times, at, poses[:, i]) for i in range(3)], axis=1)


@dataclass
class Both:
    """A scanner, and the circles with their velocities."""

    scanner: Scanner

    def __call__(self, moment: Moment) -> Any:
        """Scan and circles."""
        return [*self.scanner(moment), *(kl.Circle(*row) for row in rows_only(moment).tolist())]
