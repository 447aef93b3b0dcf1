"""Options that several commands share: which robot, what it may do, how it is driven, and watched.

An option that replaces a key of the robot file is stored under its name there, ``section.key``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import DRIVERS, TOPICS, Robot, load_robot
from firmware_bridge.sensors.lidar.options import LIDARS
from kmpc_lite.cli.command import need, positive
from kmpc_lite.cli.options import TURN_SHARE
from kmpc_lite.reading import parse_toml

if TYPE_CHECKING:
    from firmware_bridge.live.address import LiveAddress

Add = Callable[..., object]
LAST_PORT = 65535
HOST, PORT = "127.0.0.1", 8764  # as `firmware_bridge.live` has them: a help need not wait for that


def add_robot_options(parser: argparse.ArgumentParser) -> None:
    """Add where the robot is and what it may do; each option replaces a key of the robot file."""
    parser.add_argument("robot", nargs="?", help="robot file (TOML): kmpc init writes one")
    add = parser.add_argument_group("instead of keys of the robot file").add_argument
    names = ", ".join(DRIVERS)
    _add(add, "--driver", "link.driver", names, choices=DRIVERS, metavar="NAME")
    where = (
        "serial:PATH?baud=..., a device's path, pty:PATH, tcp:HOST:PORT, "
        "udp:HOST:PORT (sends there), udp:HOST:PORT?listen=1 (waits there)"
    )
    _add(add, "--link", "link.url", where, metavar="URL")
    capture = "udp:HOST:PORT where motion capture sends `stamp x y theta` (ENU, m, rad)"
    _add(add, "--pose", "link.pose", capture, metavar="URL")
    answer = "how long the board may take to answer [s]"
    _add(add, "--timeout", "link.timeout", answer, type=float, metavar="S")
    add_limits(add)


def add_limits(add: Add) -> None:
    """Add what the robot may do, and any other key of a robot file."""
    text = "limits.v_max and v_reverse [m/s] (default: 0.3, slow on purpose)"
    add("--v-max", "--max-speed", dest="limits.v_max", type=float, metavar="V", help=text)
    text = "limits.omega_max [rad/s] (default: 0.8)"
    add("--omega-max", dest="limits.omega_max", type=float, metavar="OMEGA", help=text)
    text = "limits.acceleration [m/s^2], and angular_acceleration: 4 A [rad/s^2]"
    add("--max-acceleration", dest="limits.acceleration", type=float, metavar="A", help=text)
    add(
        "--geofence",
        dest="safety.geofence",
        nargs=4,
        type=float,
        metavar=("XMIN", "YMIN", "XMAX", "YMAX"),
        help="safety.geofence [m]",
    )
    _add(add, "--lidar", "lidar.driver", ", ".join(LIDARS), choices=LIDARS, metavar="NAME")
    where = "serial:PATH, pty:PATH, tcp:HOST:PORT, udp:HOST:PORT"
    _add(add, "--lidar-link", "lidar.link", where, metavar="URL")
    _add(add, "--socket", "safety.socket", "path of the emergency stop's socket", metavar="PATH")
    text = (
        "any other key of a robot file, in TOML: board.rate=50; of kmpc run also an option "
        "of the\ncontroller: margins.headway=0.2"
    )
    add("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help=text)


def _add(add: Add, flag: str, key: str, text: str, **more: Any) -> None:
    """Add an option that replaces a key of the robot file."""
    add(flag, dest=key, help=f"{key}: {text}", **more)


def add_drive_options(parser: argparse.ArgumentParser) -> None:
    """Add how the robot is driven."""
    add = parser.add_argument_group("driving").add_argument
    arm = "arm an autopilot and choose GUIDED; else the pilot does both"
    add("--arm", dest="board.arm", action="store_const", const=True, help=arm)
    add_loop_options(add)
    period = "time between commands on the wire [s] (default: 0.02)"
    _add(add, "--command-period", "control.command_period", period, type=float, metavar="S")


def add_loop_options(add: Add) -> None:
    """Add the controller's period, what is known of its lateness, and its priority."""
    period = "of the controller [s]; default: the model's"
    _add(add, "--period", "control.period", period, type=float, metavar="S")
    latency = "from wire to wheels [s] (default: 0; 0.2 for an autopilot if the model has no lags)"
    _add(add, "--latency", "control.latency", latency, type=float, metavar="S")
    realtime = "ask for real-time priority, and report what was refused"
    add("--realtime", action="store_true", help=realtime)


def add_course_options(add: Add) -> None:
    """Add the model that plans, when a goal counts as held, and where the drive is recorded."""
    learned = "learned model (kmpc fit); default: the nominal unicycle"
    add("--model", dest="control.model", metavar="FILE", help=learned)
    text = (
        "drive even if the model has another vehicle or period, or was learned from slower driving"
    )
    add("--trust-model", dest="control.trust_model", action="store_true", default=None, help=text)
    held = "how long the goal must be held [s] (default: 1)"
    add("--settle", type=positive, metavar="S", default=1.0, help=held)
    text = (
        "new folder for the drive: drive.mcap (kmpc report DIR shows it, Foxglove plays it),\n"
        "drive.csv, and what went over the link"
    )
    add("--record", type=Path, metavar="DIR", help=text)


def read_robot(options: argparse.Namespace) -> Robot:
    """Read the robot file under the options of a command line.

    Raises ConfigError: names the option, or file, section and key. Raises MissingExtra where the
    robot's driver needs an extra that is not installed.
    """
    overrides = overrides_of(options)
    robot = load_robot(options.robot, overrides)
    if vars(options).get("board.arm") and not robot.is_autopilot:
        raise ConfigError(
            f"--arm: only an autopilot is armed; {robot.link.driver} drives as soon as the bridge "
            "runs"
        )
    need_driver(robot)
    return robot


def overrides_of(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Sections and keys that a command line replaces; ConfigError for what is none."""
    overrides: dict[str, dict[str, Any]] = {}
    for name, value in vars(options).items():
        section, dot, key = name.partition(".")
        if dot and value is not None:
            overrides.setdefault(section, {})[key] = value
    limits = overrides.get("limits", {})
    if "v_max" in limits:
        limits["v_reverse"] = limits["v_max"]
    if "acceleration" in limits:
        limits["angular_acceleration"] = TURN_SHARE * limits["acceleration"]
    for item in vars(options).get("set", ()):
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


def add_live_options(parser: argparse.ArgumentParser) -> None:
    """Add what `live_address` reads."""
    add = parser.add_argument_group("watch and stop it in a browser").add_argument
    text = "serve a page with map, numbers and STOP to browsers of this computer; prints its link"
    add("--live", action="store_true", help=text)
    text = f"--live at this port (default: {PORT}; 0: any that is free)"
    add("--live-port", type=port, metavar="PORT", help=text)
    text = (
        "--live at this address, 0.0.0.0 for all: other computers and phones of the network\n"
        f"then need the token in the link (default: {HOST})"
    )
    add("--live-host", metavar="HOST", help=text)


def port(text: str) -> int:
    """Read a port."""
    if not (text.isascii() and text.isdigit() and int(text) <= LAST_PORT):
        raise argparse.ArgumentTypeError(f"expected a port from 0 to {LAST_PORT}, got {text}")
    return int(text)


def live_address(options: argparse.Namespace) -> LiveAddress | None:
    """Where the page is to be served; None if none is asked for."""
    if not (options.live or options.live_port is not None or options.live_host):
        return None
    from firmware_bridge.live.address import LiveAddress

    return LiveAddress(
        options.live_host or HOST, PORT if options.live_port is None else options.live_port
    )
