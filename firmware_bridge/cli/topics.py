"""Options of a ROS 2 network: which node, and where it is."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firmware_bridge.ros2.node import NodeOptions


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
    add(
        "--namespace",
        default="/",
        metavar="NAME",
        help="namespace of the node and its relative topics",
    )
    add(
        "--stamped",
        action=argparse.BooleanOptionalAction,
        help="commands are TwistStamped (default: of kilted, where Nav2's are)",
    )
    add("--use-sim-time", action="store_true", help="take the time from /clock")


def node_options(options: argparse.Namespace, name: str, *connect: str) -> NodeOptions:
    """Read which node, and where the network is; `connect` if no option tells."""
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
