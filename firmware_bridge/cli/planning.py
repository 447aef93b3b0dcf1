"""The controller as the bridge's loop asks it: a pose and a scan in, a command out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import command_of, speeds_of
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.navigator import Pose

if TYPE_CHECKING:
    from firmware_bridge.runtime.navigator import Moment, Step
    from firmware_bridge.runtime.route import Route


Look = Callable[["Moment"], tuple[list[Any], Any] | None]
"""What a robot sees: obstacles, and the scan among them, if any; None while it is blind."""
Watcher = Callable[[Pose, Any, Any], None]
"""Receives each pose, its plan and its scan, in the thread that plans."""


def planning(
    robot: Robot,
    scenario: Any,
    controller: Any,
    route: Route,
    watchers: Sequence[Watcher],
    look: Look | None = None,
) -> Step:
    """Give what plans from a pose to the present goal, past what the robot knows and sees.

    With `look`, its obstacles count instead of the lidar's, and who drives to goals that come while
    it drives plans nothing at a goal that is held: others may drive then.
    """
    from firmware_bridge.runtime.navigator import Planned

    solids = () if scenario.solids is None else scenario.solids.solids
    inputs = controller.problem.wheels.inputs
    told, yields = robot.control.map, look is not None and route.clicked
    waits = "no goal yet" if yields else "no goal yet: tap the map of the live page"
    if look is None:
        look = _by_lidar if robot.lidar is not None else _nothing

    def step(pose: Pose, circles: Any, moment: Moment) -> Planned:
        if route.idle or (yields and route.done):
            return Planned(0.0, 0.0, "NO_GOAL", "the goal is held" if route.done else waits)
        if (seen := look(moment)) is None:
            return Planned(0.0, 0.0, "NO_SCAN")
        obstacles = [*(circles if told else ()), *(solids if told else ()), *seen[0]]
        plan = controller.step(pose, route.goal, obstacles, sent=command_of(moment.held, inputs))
        if len(route.goals) > 1:
            plan = replace(plan, leg=route.leg)
        for saw in watchers:
            saw(pose, plan, seen[1])
        v, omega, vy = speeds_of(plan.command)
        return Planned(v, omega, plan.status.name, plan.reason, vy)

    return step


class SeenGap:
    """Distance of a pose to what was seen at the last plan: a `Watcher`."""

    def __init__(self) -> None:
        self._around: Any = None

    def saw(self, pose: Pose, plan: Any, scan: Any) -> None:
        """Take a plan."""
        self._around = plan.around

    def __call__(self, pose: Pose, time: float) -> float:
        """Distance between the edges [m]; infinite before the first plan."""
        import numpy as np

        return math.inf if self._around is None else float(self._around.clearance(np.array([pose])))


def _nothing(moment: Moment) -> tuple[list[Any], Any]:
    return [], None


def _by_lidar(moment: Moment) -> tuple[list[Any], Any] | None:
    if moment.scan is None:
        return None
    scan = laser_scan(moment.scan)
    return [scan], scan


def laser_scan(scan: Any) -> Any:
    """Make the controller's scan of the bridge's (`firmware_bridge.sensors.scan.Scan`).

    Its age is zero: the mount already says where the sensor was, as seen from the step's pose.
    """
    import kmpc_lite as kl

    return kl.LaserScan(
        scan.ranges,
        scan.angle_min,
        scan.angle_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        mount=scan.mount,
        noise=scan.noise,
    )
