"""The proximity sensor of an emulated autopilot: OBSTACLE_DISTANCE, 72 sectors around it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from kmpc_lab.emulator.lidar.lidar import LidarModel, Pose
from kmpc_lite.scenario.world import World

SECTORS = 72
RAYS = 5
"""Of each sector, which tells the nearest that they hit."""
NEAREST = 5
"""[cm]"""
BODY_FRD = 12
"""MAV_FRAME: clockwise from the vehicle's front."""
MODEL = LidarModel(beams=SECTORS, reach=8.0)


class SectorSensor:
    """Looks around whenever it is asked.

    Parameters
    ----------
    world : World
        What it sees.
    model : LidarModel
        How good it is, and where it is mounted.
    seed : int
        Of the noise.
    """

    def __init__(self, world: World, model: LidarModel = MODEL, seed: int = 0) -> None:
        self._world, self._model = world, model
        self._noise = np.random.default_rng(seed)

    def message(self, pose: Pose, uptime: float) -> Any:
        """OBSTACLE_DISTANCE of a vehicle at x, y [m], theta [rad], so long after boot [s]."""
        model, (x, y, theta) = self._model, pose
        ahead, left, turn = model.mount
        cos, sin = math.cos(theta), math.sin(theta)
        place = np.array([x + cos * ahead - sin * left, y + sin * ahead + cos * left])
        ray = (np.arange(SECTORS * RAYS) - (RAYS - 1) / 2) * math.tau / (SECTORS * RAYS)
        directions = theta + turn - ray
        ranges = self._world.ranges(place, directions, uptime)
        nearest = ranges.reshape(SECTORS, RAYS).min(axis=1)
        nearest = nearest + self._noise.normal(0.0, model.noise, SECTORS)
        reach = round(100 * model.reach)
        told = [
            reach + 1 if not d <= model.reach else max(NEAREST, round(100.0 * d)) for d in nearest
        ]
        step = 360 // SECTORS
        return dialect.MAVLink_obstacle_distance_message(
            int(1e6 * uptime), 0, told, step, NEAREST, reach, float(step), 0.0, BODY_FRD
        )
