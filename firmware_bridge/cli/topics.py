"""`kmpc emulate ros2`: options of a robot behind ROS 2 topics, and the network's of `kmpc ros2`."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.cli.options import people
from kmpc_lite.cli.extras import need

if TYPE_CHECKING:
    from firmware_bridge.emulator.ros2.robot import Ros2Emulator
    from firmware_bridge.ros2.node import NodeOptions

ROUTER_URL = "tcp:127.0.0.1:7447"
"""Where an emulated robot is the router, unless told."""
SCENARIO = "four_circles_1"
"""Among whose obstacles it stands, unless told."""


def add_network_options(parser: argparse.ArgumentParser) -> None:
    """Add which node, and where the network is."""
    add = parser.add_argument_group("ROS 2 network").add_argument
    add(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="Zenoh router or peer (default of kmpc ros2: tcp/localhost:7447, as rmw_zenohd)",
    )
    add(
        "--distro",
        default="jazzy",
        metavar="NAME",
        help="distribution of the others: jazzy (default), kilted, humble",
    )
    add("--domain", type=int, default=0, metavar="N", help="ROS_DOMAIN_ID (default: 0)")
    add("--namespace", default="/", metavar="NAME", help="of the node and its relative topics")
    add(
        "--stamped",
        action=argparse.BooleanOptionalAction,
        help="commands are TwistStamped (default: of kilted, where Nav2's are)",
    )
    add("--use-sim-time", action="store_true", help="stamps are of /clock")


def add_topic_options(parser: argparse.ArgumentParser) -> None:
    """Add what only a robot behind topics has."""
    add_network_options(parser)
    parser.add_argument(
        "--sees",
        action="append",
        choices=("map", "scan", "nothing"),
        help="ros2: which topics tell of obstacles (default: map and scan); more than once",
    )


def node_options(options: argparse.Namespace, name: str, *connect: str) -> NodeOptions:
    """Read which node, and where the network is; `connect` where no option tells."""
    from firmware_bridge.ros2.node import NodeOptions

    return NodeOptions(
        name=name,
        namespace=options.namespace,
        domain=options.domain,
        distribution=options.distro,
        connect=tuple(options.connect or connect),
    )


def is_stamped(options: argparse.Namespace) -> bool:
    """Whether commands are TwistStamped."""
    return options.distro == "kilted" if options.stamped is None else bool(options.stamped)


def emulate_topics(options: argparse.Namespace) -> int:
    """Emulate a robot behind topics until Ctrl-C, or for so long."""
    from firmware_bridge.cli.emulate import emulate

    url = options.link or ROUTER_URL
    report = emulate(topic_robot(options), url, options.seconds, people(options))
    if options.json:
        print(json.dumps(report))
    return 0


def topic_robot(options: argparse.Namespace) -> Ros2Emulator:
    """Build the emulated robot that the options of a command line ask for."""
    need("kmpc emulate ros2", "zenoh", "rosbags")
    from firmware_bridge.emulator.ros2.robot import EmulatedRobot, Ros2Emulator
    from kmpc_lite.sim import Scenario

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
