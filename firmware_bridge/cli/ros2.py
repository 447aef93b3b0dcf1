"""`kmpc ros2`: drive a robot whose link are ROS 2 topics, without a ROS installation."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.cli.options import (
    add_course_options,
    add_limits,
    add_loop_options,
    overrides_of,
    people,
    prepare,
)
from firmware_bridge.cli.topics import add_network_options, is_stamped, node_options
from firmware_bridge.messages import BridgeError, ConfigError
from firmware_bridge.robot_file import TOPICS, Robot, load_robot
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need, part
from kmpc_lite.cli.numbers import number, positive
from kmpc_lite.cli.output import command_line

if TYPE_CHECKING:
    from firmware_bridge.ros2.options import Ros2Options

RESUME = 30.0
"""A robot whose odometry or scan is lost stands for so long, and goes on by itself when they come
back [s]; later a new goal is needed. safety.resume of a robot file says otherwise."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    parser.add_argument("robot", nargs="?", help="robot file (TOML): limits, safety, control")
    add_network_options(parser)
    add = parser.add_argument_group("topics").add_argument
    add("--name", default="kmpc", help="name of the node (default: kmpc)")
    add(
        "--topic",
        action="append",
        default=[],
        metavar="ROLE=NAME",
        help="name of a topic: odom, tf, tf_static, clock, goal, scan, map, cmd_vel, plan,\n"
        "markers, diagnostics; scan and map more than once; `scan=` leaves it out",
    )
    add("--frame", default="map", help="frame of map and goal (default: map)")
    add(
        "--pose-from-tf",
        action="store_true",
        help="read the pose of --base from TF instead of an odometry topic",
    )
    add("--base", default="base_link", help="frame of the robot with --pose-from-tf")
    add(
        "--scan-age",
        type=float,
        default=0.5,
        metavar="S",
        help="oldest scan to drive by [s] (default: 0.5)",
    )
    add(
        "--scan-mount",
        nargs=3,
        type=number,
        metavar=("X", "Y", "THETA"),
        help="pose of the scanner on the robot [m, m, rad] (default: from TF)",
    )
    add(
        "--map-age",
        type=positive,
        metavar="S",
        help="oldest map to drive by [s] (default: any, since a map server sends it once)",
    )
    add(
        "--map-threshold",
        type=float,
        default=65.0,
        metavar="VALUE",
        help="cells from this value on are occupied (default: 65); 100 for a costmap",
    )
    add("--unknown-is-free", action="store_true", help="drive through unknown cells of the map")
    add_limits(parser.add_argument_group("limits").add_argument)
    _add_driving(parser)


def _add_driving(parser: argparse.ArgumentParser) -> None:
    """Add how the robot is driven, and where to."""
    add = parser.add_argument_group("driving").add_argument
    add_course_options(add)
    add_loop_options(add)
    add(
        "--radius",
        type=positive,
        default=0.15,
        metavar="R",
        help="of the robot [m] (default: 0.15)",
    )
    add(
        "--goal",
        nargs=3,
        type=number,
        metavar=("X", "Y", "THETA"),
        help="drive there and end, with status 1 if it does not arrive [m, m, rad]",
    )
    add(
        "--emulate",
        metavar="SCENARIO",
        help="drive an emulated robot among a scenario's obstacles, to its goal, and end",
    )
    add("--seconds", type=positive, metavar="S", help="end after this time [s]")
    add(
        "--timeout",
        type=positive,
        default=10.0,
        metavar="S",
        help="how long to wait for the Zenoh router [s] (default: 10)",
    )


def run(options: argparse.Namespace) -> int:
    """Serve goals until Ctrl-C, or drive to one."""
    need("kmpc ros2", "zenoh", "rosbags")
    import kmpc_lite as kl
    from firmware_bridge.cli.recording import recording_to
    from firmware_bridge.cli.ros2_recording import Driven, topic_recorder
    from firmware_bridge.ros2.drive import Errand
    from firmware_bridge.ros2.drive import run as drive
    from firmware_bridge.ros2.driver import Ros2Driver
    from firmware_bridge.ros2.inputs import Goal, Inputs
    from firmware_bridge.ros2.navigator import GoalNavigator
    from firmware_bridge.ros2.node import ROUTER

    robot, emulated = _robot(options), None
    if options.emulate is not None:
        emulated = part("--emulate", "emulated_topics")(options, robot.wheels)
        robot = _robot(options)
    node = node_options(options, options.name, ROUTER)
    listened = _ros2_options(options, node.root, robot)
    try:
        drawn = None if emulated is None else emulated.footprint
        robot, controller, notes = _controller(robot, options.radius, drawn)
    except kl.KmpcError as error:
        raise ConfigError(f"{robot.where}: {error}") from error
    prepare(options)
    controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))  # the first step loads what it needs
    inputs = Inputs(listened)
    navigator = GoalNavigator(controller, inputs, options.settle)
    driver = Ros2Driver(node, listened, inputs, lambda: navigator.goal is not None)
    period = robot.control.period or controller.problem.dt
    job = Driven(controller, navigator, navigator.watchers)
    with ExitStack() as stack:
        errand = Errand(
            period=period,
            radius=options.radius,
            goal=None if options.goal is None else Goal(*options.goal),
            seconds=options.seconds,
            record=stack.enter_context(recording_to(options.record)),
            recorder=topic_recorder(job, period, command_line()),
            notes=notes,
        )
        if emulated is not None:
            stack.callback(emulated.close)
            emulated.start(node.connect[0].replace("/", ":"))
        report, status = drive(driver, robot, navigator, errand, people(options))
    if options.json:
        print(json.dumps(report))
    return status


def _robot(options: argparse.Namespace) -> Robot:
    """The robot file under the options; its link is the network."""
    overrides = overrides_of(options)
    overrides.setdefault("robot", {})["wheels"] = getattr(options, "wheels", None)
    overrides["link"] = {
        "url": ", ".join(options.connect or ("zenoh",)),
        "driver": TOPICS,
        "timeout": options.timeout,
    }
    robot = load_robot(options.robot, overrides)
    if robot.lidar is not None:
        raise ConfigError(
            f"{robot.where}: lidar: kmpc ros2 sees by topics: --topic scan=NAME, without [lidar]"
        )
    resume = robot.gate.resume if "resume" in robot.sections.get("safety", {}) else RESUME
    gate = replace(robot.gate, resume=resume, scan_age=options.scan_age)
    return replace(robot, gate=gate)


def _ros2_options(options: argparse.Namespace, namespace: str, robot: Robot) -> Ros2Options:
    """Read which topics there are, and how far they are believed."""
    from firmware_bridge.ros2.obstacles import GridOptions
    from firmware_bridge.ros2.options import Ros2Options, read_topics

    return Ros2Options(
        topics=read_topics(options.topic, namespace),
        frame=options.frame,
        base=options.base,
        pose_from_tf=options.pose_from_tf,
        stamped=is_stamped(options),
        wheels=robot.wheels,
        simulated_time=options.use_sim_time,
        scan_age=options.scan_age,
        mount=None if options.scan_mount is None else tuple(options.scan_mount),
        grid=GridOptions(options.map_threshold, options.unknown_is_free, options.map_age),
    )


def _controller(robot: Robot, radius: float, footprint: Any) -> tuple[Robot, Any, tuple[str, ...]]:
    """The robot within what its model has shown, its controller, and notes for the user.

    The robot stays within its geofence if it has one. The footprint of its file comes first, then
    that of a scenario, then the radius.
    """
    import kmpc_lite as kl
    from firmware_bridge.cli.course import adaptation, base_problem, load_model

    robot, model, notes = load_model(robot)
    if robot.footprint is not None:
        footprint = kl.Footprint.of(robot.footprint)
    inf = float("inf")
    x_min, y_min, x_max, y_max = robot.gate.geofence or (-inf, -inf, inf, inf)
    problem = replace(
        base_problem(robot, model.dt),
        robot_radius=radius if footprint is None else footprint.radius,
        footprint=footprint,
        x_min=(x_min, y_min, -inf),
        x_max=(x_max, y_max, inf),
        slack_weights=None,
    )
    return robot, kl.Controller(model, problem, adaptation=adaptation(robot)), notes


COMMAND = Command(
    text="Drive a robot of ROS 2 topics, without a ROS installation.",
    examples=(
        "kmpc ros2 --emulate four_circles_1 --v-max 0.6",
        "kmpc ros2 --model robot.npz --v-max 0.3",
        "kmpc ros2 --goal 1.5 1.5 0 --topic scan= --connect tcp/127.0.0.1:7447",
        "kmpc ros2 --distro kilted --topic map=/local_costmap/costmap --map-threshold 100",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
