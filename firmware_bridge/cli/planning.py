"""The controller as the bridge's loop asks it: a pose and a scan in, a command out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import command_of, speeds_of
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.navigator import Pose

if TYPE_CHECKING:
    from firmware_bridge.runtime.navigator import Moment, Step
    from firmware_bridge.runtime.route import Route


def planning(
    robot: Robot,
    scenario: Any,
    controller: Any,
    route: Route,
    watchers: Sequence[Callable[[Any, Any], None]],
) -> Step:
    """Give what plans from a pose to the present goal, past what the robot knows and sees."""
    from firmware_bridge.runtime.navigator import Planned

    solids = () if scenario.solids is None else scenario.solids.solids
    inputs = controller.problem.wheels.inputs
    sees, told = robot.lidar is not None, robot.control.map

    def step(pose: Pose, circles: Any, moment: Moment) -> Planned:
        if route.idle:
            return Planned(0.0, 0.0, "NO_GOAL", "no goal yet: tap the map of the live page")
        if sees and moment.scan is None:
            return Planned(0.0, 0.0, "NO_SCAN")
        obstacles = [*circles, *solids] if solids else circles
        if sees:
            obstacles = [*(obstacles if told else ()), laser_scan(moment.scan)]
        plan = controller.step(pose, route.goal, obstacles, sent=command_of(moment.held, inputs))
        if len(route.goals) > 1:
            plan = replace(plan, leg=route.leg)
        for saw in watchers:
            saw(pose, plan)
        v, omega, vy = speeds_of(plan.command)
        return Planned(v, omega, plan.status.name, plan.reason, vy)

    return step


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
