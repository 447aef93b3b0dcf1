"""Whether a robot can stand where its pose says: in no obstacle of its scenario."""

from __future__ import annotations

import math
from typing import Any

from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.navigator import Pose

DEEP = 0.5
"""A pose further inside an obstacle than this share of the robot's radius, or of its half width,
cannot be true; one that only seems to touch, for a pose's noise or a map's, may drive."""


def misplaced(scenario: Any, pose: Pose) -> str:
    """Say that a robot at a pose [m, m, rad] stands inside an obstacle; empty where it does not."""
    import numpy as np

    from kmpc_lite.scenario.gaps import obstacle_gaps

    if not all(map(math.isfinite, pose)):
        return ""
    gap = float(obstacle_gaps(scenario, np.array([pose]), np.zeros(1))[0])
    body = scenario.footprint
    if gap >= -DEEP * (scenario.radius if body is None else body.half_width):
        return ""
    x, y, theta = pose
    off = math.dist((x, y), scenario.start[:2])
    return (
        f"stands inside an obstacle by {-gap:.2f} m, at x {x:.2f} m, y {y:.2f} m, "
        f"theta {theta:.2f} rad, {off:.2f} m from the scenario's start: is frame.origin right?"
    )


def own_frame(robot: Robot, scenario: Any) -> Pose:
    """Pose of the vehicle's own frame: wheels begin at the start, others know where they are."""
    if robot.origin is not None:
        return robot.origin
    if robot.is_autopilot or robot.link.pose is not None:
        return 0.0, 0.0, 0.0
    start: Pose = scenario.start
    return start
