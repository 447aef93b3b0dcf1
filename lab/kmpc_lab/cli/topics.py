"""`kmpc emulate ros2`: a robot behind ROS 2 topics, by itself or for `kmpc ros2 --emulate`."""

from __future__ import annotations

import argparse
import json
import socket
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.cli.options import people
from firmware_bridge.cli.topics import add_network_options, is_stamped, node_options
from firmware_bridge.messages import ConfigError
from kmpc_lite.cli.extras import need

if TYPE_CHECKING:
    from firmware_bridge.wheels import Wheels
    from kmpc_lab.emulator.ros2.robot import Ros2Emulator

ROUTER_URL = "tcp:127.0.0.1:7447"
"""Default address at which an emulated robot is the router."""
SCENARIO = "four_circles_1"
"""Default scenario of its obstacles."""


def add_topic_options(parser: argparse.ArgumentParser) -> None:
    """Add what only a robot behind topics has."""
    add_network_options(parser)
    parser.add_argument(
        "--sees",
        action="append",
        choices=("map", "scan", "nothing"),
        help="ros2: topics that show obstacles (default: map and scan); repeatable",
    )


def emulate_topics(options: argparse.Namespace) -> int:
    """Emulate a robot behind topics until Ctrl-C, or for so long."""
    from kmpc_lab.cli.emulate import emulate

    url = options.link or ROUTER_URL
    report = emulate(topic_robot(options), url, options.seconds, people(options))
    if options.json:
        print(json.dumps(report))
    return 0


def topic_robot(options: argparse.Namespace) -> Ros2Emulator:
    """Build the emulated robot that the options of a command line ask for."""
    need("kmpc emulate ros2", "zenoh", "rosbags")
    from kmpc_lab.emulator.ros2.robot import EmulatedRobot, Ros2Emulator
    from kmpc_lite.scenario.files import Scenario

    given: dict[str, Any] = {
        "start": None if options.start is None else tuple(options.start),
        "slip": options.slip,
        "turn_gain": options.turn_gain,
    }
    scenario = replace(
        Scenario.load(options.scenario or SCENARIO),
        **{name: value for name, value in given.items() if value is not None},
    )
    robot = EmulatedRobot(
        sees=tuple(options.sees or ("map", "scan")),
        stamped=is_stamped(options),
        simulated_time=options.use_sim_time,
    )
    return Ros2Emulator(node_options(options, "emulated_robot"), scenario, robot, options.seed)


def emulated_for(options: argparse.Namespace, wheels: Wheels) -> Ros2Emulator:
    """Build the robot of `kmpc ros2 --emulate`; its network, goal and wheels are the command's.

    The `wheels` of a robot file come before the scenario's, unless they are the usual ones.
    """
    from kmpc_lab.emulator.ros2.robot import EmulatedRobot, Ros2Emulator
    from kmpc_lite.control.wheels import read_wheels, wheels_to_table
    from kmpc_lite.scenario.files import Scenario

    if options.connect:
        raise ConfigError("--emulate: the emulated robot has a network of its own; no --connect")
    scenario = Scenario.load(options.emulate)
    if wheels.kind == "differential":
        options.wheels = wheels_to_table(scenario.problem().wheels)
    else:
        scenario = replace(scenario, wheels=read_wheels(wheels.table))
    left_out = {word.partition("=")[0] for word in options.topic if word.endswith("=")}
    robot = EmulatedRobot(
        sees=tuple(name for name in ("map", "scan") if name not in left_out),
        stamped=is_stamped(options),
        simulated_time=options.use_sim_time,
        wheelbase=wheels.wheelbase or 0.0,
    )
    emulated = Ros2Emulator(node_options(options, "emulated_robot"), scenario, robot)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    options.connect, options.radius = [f"tcp/127.0.0.1:{port}"], scenario.radius
    options.goal = options.goal or scenario.goal
    return emulated
