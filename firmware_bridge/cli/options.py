"""Options that several commands share: which robot, what it may do, how it is driven."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import DRIVERS, TOPICS, Robot, load_robot
from firmware_bridge.sensors.lidar.options import LIDARS
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import positive
from kmpc_lite.cli.tuning import TURN_SHARE
from kmpc_lite.reading import parse_toml


def add_robot_options(parser: argparse.ArgumentParser) -> None:
    """Add where the robot is and what it may do; each option replaces a key of the robot file."""
    parser.add_argument("robot", nargs="?", help="robot file (TOML): kmpc init writes one")
    add = parser.add_argument_group("instead of keys of the robot file").add_argument
    add(
        "--driver",
        choices=DRIVERS,
        metavar="NAME",
        help=f"link.driver: {', '.join(DRIVERS)}",
    )
    add(
        "--link",
        metavar="URL",
        help="link.url: serial:PATH?baud=..., a device's path, pty:PATH, tcp:HOST:PORT, "
        "udp:HOST:PORT (sends there), udp:HOST:PORT?listen=1 (waits there)",
    )
    add(
        "--pose",
        metavar="URL",
        help="link.pose: udp:HOST:PORT where motion capture sends `stamp x y theta` (ENU, m, rad)",
    )
    _add_forward(add)
    add(
        "--timeout",
        type=float,
        metavar="S",
        help="link.timeout: how long the board may take to answer [s]",
    )
    add_limits(add)


def add_limits(add: Callable[..., object]) -> None:
    """Add what the robot may do, and any other key of a robot file."""
    add(
        "--v-max",
        "--max-speed",
        dest="v_max",
        type=float,
        metavar="V",
        help="limits.v_max and v_reverse [m/s] (default: 0.3, slow on purpose)",
    )
    add(
        "--omega-max",
        type=float,
        metavar="OMEGA",
        help="limits.omega_max [rad/s] (default: 0.8)",
    )
    add(
        "--max-acceleration",
        type=float,
        metavar="A",
        help="limits.acceleration [m/s^2], and angular_acceleration: 4 A [rad/s^2]",
    )
    add(
        "--geofence",
        nargs=4,
        type=float,
        metavar=("XMIN", "YMIN", "XMAX", "YMAX"),
        help="safety.geofence [m]",
    )
    add_lidar_options(add)
    add("--socket", metavar="PATH", help="safety.socket: path of the emergency stop's socket")
    add(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="any other key of a robot file, in TOML: board.rate=50; of kmpc run also an option "
        "of the\ncontroller: margins.headway=0.2",
    )


def add_lidar_options(add: Callable[..., object]) -> None:
    """Add which lidar the robot has."""
    add(
        "--lidar",
        choices=LIDARS,
        metavar="NAME",
        help=f"lidar.driver: {', '.join(LIDARS)} (an autopilot's own sensors)",
    )
    add(
        "--lidar-link",
        metavar="URL",
        help="lidar.link: serial:PATH, pty:PATH, tcp:HOST:PORT, udp:HOST:PORT",
    )


def _add_forward(add: Callable[..., object]) -> None:
    add(
        "--forward",
        action="append",
        metavar="URL",
        help="link.forward: share an autopilot with QGroundControl or MAVProxy, repeatable:\n"
        "udp:127.0.0.1:14550 (sends there), udp:HOST:PORT?listen=1 (waits there)",
    )


def add_drive_options(parser: argparse.ArgumentParser) -> None:
    """Add how the robot is driven."""
    add = parser.add_argument_group("driving").add_argument
    add(
        "--arm",
        action="store_true",
        help="arm an autopilot and choose GUIDED; else the pilot does both",
    )
    add_loop_options(add)
    add(
        "--command-period",
        type=float,
        metavar="S",
        help="control.command_period: time between commands on the wire [s] (default: 0.02)",
    )


def add_loop_options(add: Callable[..., object]) -> None:
    """Add the controller's period, what is known of its lateness, and its priority."""
    add(
        "--period",
        type=float,
        metavar="S",
        help="control.period: of the controller [s]; default: the model's",
    )
    add(
        "--latency",
        type=float,
        metavar="S",
        help="control.latency: from wire to wheels [s] "
        "(default: 0; 0.2 for an autopilot if the model has no lags)",
    )
    add(
        "--realtime",
        action="store_true",
        help="ask for real-time priority, and report what was refused",
    )


def add_course_options(add: Callable[..., object]) -> None:
    """Add the model that plans, when a goal counts as held, and where the drive is recorded."""
    add(
        "--model",
        metavar="FILE",
        help="learned model (kmpc fit); default: the nominal unicycle",
    )
    add(
        "--trust-model",
        action="store_true",
        default=None,
        help="drive even if the model has another vehicle or period, or was learned from slower "
        "driving",
    )
    held = "how long the goal must be held [s] (default: 1)"
    add("--settle", type=positive, metavar="S", default=1.0, help=held)
    add(
        "--record",
        type=Path,
        metavar="DIR",
        help="new folder for the drive: drive.mcap (kmpc report DIR shows it, Foxglove plays it),\n"
        "drive.csv, and what went over the link",
    )


def read_robot(options: argparse.Namespace) -> Robot:
    """Read the robot file under the options of a command line.

    Raises
    ------
    ConfigError
        Names the option, or file, section and key.
    MissingExtra
        Where the robot's driver needs an extra that is not installed.
    """
    overrides = overrides_of(options)
    robot = load_robot(vars(options).get("robot"), overrides)
    if vars(options).get("arm") and not robot.is_autopilot:
        raise ConfigError(
            f"--arm: only an autopilot is armed; {robot.link.driver} drives as soon as the bridge "
            "runs"
        )
    need_driver(robot)
    return robot


def overrides_of(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Sections and keys that a command line replaces; ConfigError for what is none."""
    given = vars(options)
    acceleration = given.get("max_acceleration")
    overrides: dict[str, dict[str, Any]] = {
        "link": {
            "url": given.get("link"),
            "driver": given.get("driver"),
            "timeout": given.get("timeout"),
            "pose": given.get("pose"),
            "forward": " ".join(given.get("forward") or ()) or None,
        },
        "lidar": {"driver": given.get("lidar"), "link": given.get("lidar_link")},
        "board": {"arm": True if given.get("arm") else None},
        "limits": {
            "v_max": given.get("v_max"),
            "v_reverse": given.get("v_max"),
            "omega_max": given.get("omega_max"),
            "acceleration": acceleration,
            "angular_acceleration": None if acceleration is None else TURN_SHARE * acceleration,
        },
        "safety": {"geofence": given.get("geofence"), "socket": given.get("socket")},
        "control": {
            name: given.get(name)
            for name in (
                "period",
                "command_period",
                "latency",
                "model",
                "scenario",
                "trust_model",
            )
        },
    }
    overrides["control"]["map"] = False if given.get("by_sight") else None
    for item in given.get("set", []):
        section, key, value = _assignment(item)
        overrides.setdefault(section, {})[key] = value
    return overrides


def need_driver(robot: Robot) -> None:
    """Refuse a robot whose driver, or whose emulator, needs an extra that is not installed."""
    if robot.link.driver == TOPICS:
        raise ConfigError(f"{robot.where}: link.driver: a robot of ROS 2 is driven by kmpc ros2")
    if robot.is_autopilot:
        need(f"{robot.where}: the driver mavlink", "pymavlink")


def _assignment(item: str) -> tuple[str, str, Any]:
    """Section, key and value of SECTION.KEY=VALUE."""
    name, equals, value = item.partition("=")
    section, dot, key = name.strip().partition(".")
    try:
        if not (equals and dot):
            raise ValueError
        return section, key, parse_toml(f"value = {value}")["value"]
    except ValueError:
        raise ConfigError(
            f"--set {item}: expected SECTION.KEY=VALUE with a TOML value "
            '(text in quotes: board.role="gcs")'
        ) from None


def prepare(options: argparse.Namespace) -> None:
    """Make the process fit for a control loop, where asked."""
    from kmpc_lite.realtime import prepare_process

    for line in prepare_process() if options.realtime else ():
        sys.stderr.write(f"{line}\n")


def people(options: argparse.Namespace) -> TextIO | None:
    """Where to show people what happens."""
    return None if options.json else sys.stdout
