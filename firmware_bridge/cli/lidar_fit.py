"""Whether a scan fits the map, and with which mount it would: for `kmpc check`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from firmware_bridge.cli.course import scenario_of
from firmware_bridge.cli.standing import own_frame
from firmware_bridge.messages import State
from firmware_bridge.robot_file import Robot
from firmware_bridge.sensors.placed import placed

if TYPE_CHECKING:
    from firmware_bridge.sensors.scan import Scan
    from kmpc_lite.scenario.world import World

DIRECTIONS = 720
"""Into which the map is looked at from the sensor."""
NEAR, SHARE = 0.1, 0.05
"""A hit fits the map within so much [m], and so much of its distance."""
BETTER = 0.25
"""Share of hits that another mount must fit more, to be proposed."""
FEW = 20
"""Fewer hits tell nothing."""


def against_map(scan: Scan, state: State, robot: Robot) -> list[str]:
    """Lines on how a scan, seen from a pose in the vehicle's own frame, fits the robot's map.

    Raises
    ------
    ConfigError
        For a scenario that cannot be read.
    """
    from kmpc_lite.scenario.world import world_of

    assert robot.lidar is not None
    scenario = scenario_of(robot)
    here = placed(state, own_frame(robot, scenario))
    pose = here.x, here.y, here.theta
    return fit(scan, pose, world_of(scenario), robot.lidar.mirrored)


def fit(scan: Scan, pose: tuple[float, float, float], world: World, mirrored: bool) -> list[str]:
    """Lines on how a scan fits a world, seen from a pose x, y [m], theta [rad]."""
    hits = np.isfinite(scan.ranges)
    if hits.sum() < FEW:
        return []
    ahead, left, turn = scan.mount
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    place = np.array([pose[0] + cos * ahead - sin * left, pose[1] + sin * ahead + cos * left])
    step = math.tau / DIRECTIONS
    directions = step * np.arange(DIRECTIONS)
    there = world.ranges(place, directions)
    ranges, angles = scan.ranges[hits], scan.angles[hits]

    def fits(flipped: bool, other: Any) -> Any:
        """Share of hits (K,) that fit with the sensor turned by (K,) more [rad]."""
        own = -angles if flipped else angles
        index = np.round((pose[2] + turn + other[:, None] + own) / step).astype(int) % DIRECTIONS
        return (np.abs(there[index] - ranges) < NEAR + SHARE * ranges).mean(axis=1)

    turns = np.radians(np.arange(0, 360, 5))
    now = float(fits(False, np.zeros(1))[0])
    found = [f"lidar: {100.0 * now:.0f} % of its hits lie where the map has something"]
    shares = [fits(flipped, turns) for flipped in (False, True)]
    best = int(np.argmax(shares))
    flipped, most = best >= len(turns), float(np.max(shares))
    if most > now + BETTER:
        third = math.remainder(turn + float(turns[best % len(turns)]), math.tau)
        found.append(
            f"hint: {100.0 * most:.0f} % would with lidar.mirrored = "
            f"{str(mirrored != flipped).lower()} and {third:.2f} as lidar.mount's third number, "
            "if the robot stands where the pose says"
        )
    return found
