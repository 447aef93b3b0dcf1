"""A simulated laser scanner: what it sends of the rays that a world meets."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.values import LidarSpec as LidarSpec
from kmpc_lite.scenario.world import World, world_of
from kmpc_lite.types import Array


def scan_ranges(
    world: World, spec: LidarSpec, pose: Array, random: np.random.Generator, time: float = 0.0
) -> tuple[Array, Array]:
    """What the scanner sends from a pose (3,), and its directions in its own frame, (B,), (B,).

    Ranges are infinite if nothing is within reach, and NaN if a beam does not come back.
    """
    directions = 2.0 * math.pi / spec.beams * np.arange(spec.beams) - math.pi
    ranges = world.ranges(pose[:2], pose[2] + directions, time)
    ranges = ranges + spec.noise * random.normal(size=spec.beams)
    ranges = np.where(ranges > spec.reach, np.inf, np.maximum(ranges, 0.0))
    ranges[ranges < spec.nearest] = 0.0
    ranges[random.random(spec.beams) < spec.dropout] = np.nan
    return ranges, directions


def scan_of(spec: LidarSpec, ranges: Array, age: float = 0.0) -> LaserScan:
    """What `scan_ranges` gave, as the controller takes it, at an age [s]."""
    step = 2.0 * math.pi / spec.beams
    return LaserScan(
        *(ranges, -math.pi, step, spec.reach, spec.nearest, spec.mount), noise=spec.noise, age=age
    )


def box_edges(x1: float, y1: float, x2: float, y2: float) -> Array:
    """The four sides (4, 4) of a rectangle along the axes."""
    corners = np.array([(x1, y1), (x2, y1), (x2, y2), (x1, y2)])
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


class Lidar:
    """The scanner on a scenario's robot.

    `scenario`: what there is to see, and the seed of the noise. `spec`: how it is seen.
    """

    def __init__(self, scenario: Scenario, spec: LidarSpec) -> None:
        self.spec, self._world = spec, world_of(scenario)
        self._random = np.random.default_rng([scenario.seed, 2])
        self.seen: list[tuple[float, LaserScan]] = []
        """Its turns: when each ended [s], and what it saw."""

    def scan(self, pose: Array, time: float) -> LaserScan:
        """What it saw last, from a pose (3,) at a time [s]."""
        spec = self.spec
        if self.seen and spec.rate:
            last, scan = self.seen[-1]
            if (time - last) * spec.rate < 1.0 - 1e-6:
                return scan_of(spec, scan.ranges, time - last)
        ahead, left, heading = spec.mount
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        x, y = pose[0] + cos * ahead - sin * left, pose[1] + sin * ahead + cos * left
        place = np.array([x, y, pose[2] + heading])
        ranges, _ = scan_ranges(self._world, spec, place, self._random, time)
        scan = scan_of(spec, ranges)
        self.seen.append((time, scan))
        return scan
