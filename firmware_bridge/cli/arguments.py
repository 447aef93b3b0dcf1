"""The command line of kmpc-bridge: options, defaults, examples."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

from firmware_bridge.robot_file import DRIVERS

MEASURED = tuple(name for name in DRIVERS if name != "sabertooth")
"""Drivers whose latency can be measured: a Sabertooth says nothing."""

DRIVE_TIME = 120.0
"""How long a run may take unless told [s]: low speeds take longer than a scenario's own limit."""


def build_parser(
    runs: Mapping[str, Callable[[argparse.Namespace], int]],
) -> argparse.ArgumentParser:
    """Build the parser of kmpc-bridge; `runs` carries out the commands, by name."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="kmpc-bridge",
        description="Drive a robot's motors, safely: ArduPilot Rover, RoboClaw, ODrive, VESC; PX4 is left out.",
    )
    commands = parser.add_subparsers(required=True, metavar="command")

    def command(name: str, text: str, example: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(
            name, help=text, description=text, epilog=f"example:\n  {example}", formatter_class=raw
        )
        sub.set_defaults(run=runs[name])
        sub.add_argument(
            "--json", action="store_true", help="one JSON object on standard output, for machines"
        )
        return sub

    sub = command(
        "check",
        "say who answers, and what is missing before it can drive",
        "kmpc-bridge check robot.toml",
    )
    _robot_options(sub)
    sub.add_argument(
        "--seconds",
        type=_positive,
        default=2.0,
        help="how long to watch the telemetry [s] (default 2)",
    )

    sub = command(
        "run",
        "drive a scenario with a learned model",
        "kmpc-bridge run --driver mavlink --link tcp:127.0.0.1:5760 --model robot.npz --scenario four_circles_1 --arm",
    )
    _robot_options(sub)
    _drive_options(sub)
    sub.add_argument(
        "--model", help="learned model (kmpc fit); the nominal unicycle where not given"
    )
    sub.add_argument(
        "--scenario", help="scenario file, or the name of one that comes with kmpc_lite"
    )
    sub.add_argument(
        "--seconds",
        type=_positive,
        default=DRIVE_TIME,
        help=f"give up after so long [s] (default {DRIVE_TIME:g})",
    )
    sub.add_argument(
        "--settle",
        type=_positive,
        default=1.0,
        help="how long the goal must be held [s] (default 1)",
    )
    sub.add_argument(
        "--record", metavar="NAME", help="record to NAME.csv and NAME.tlog or NAME.raw"
    )

    sub = command(
        "record",
        "record a drive to learn from: by hand, or at random inside a fence",
        "kmpc-bridge record robot.toml --excite --geofence -2 -2 2 2 --seconds 300 --output drive",
    )
    _robot_options(sub)
    _drive_options(sub)
    sub.add_argument(
        "--output",
        required=True,
        metavar="NAME",
        help="record to NAME.csv and NAME.tlog or NAME.raw",
    )
    how = sub.add_mutually_exclusive_group(required=True)
    how.add_argument(
        "--by-hand", action="store_true", help="somebody else drives; nothing is sent to the robot"
    )
    how.add_argument(
        "--excite",
        action="store_true",
        help="drive at random in the four sign scenarios, inside the geofence",
    )
    sub.add_argument(
        "--seconds", type=_positive, default=300.0, help="for how long [s] (default 300)"
    )
    sub.add_argument(
        "--hold",
        type=_positive,
        default=0.5,
        help="how long a random command is held [s] (default 0.5)",
    )
    sub.add_argument("--seed", type=int, default=0, help="of the random commands (default 0)")

    sub = command(
        "replay",
        "summarise a recorded log, make a CSV of it, play it to a link, or mend what a power cut tore",
        "kmpc-bridge replay drive.tlog --csv a.csv",
    )
    sub.add_argument("log", help="NAME.tlog, NAME.raw or NAME.csv")
    sub.add_argument(
        "--mend", action="store_true", help="of NAME.csv: cut off the row that a power cut tore"
    )
    sub.add_argument(
        "--csv",
        metavar="FILE",
        help="write the poses and measured speeds of a tlog as a log for kmpc fit",
    )
    sub.add_argument(
        "--period", type=_positive, default=0.1, help="of the CSV's rows [s] (default 0.1)"
    )
    sub.add_argument("--system", type=int, default=1, help="MAVLink id of the vehicle (default 1)")
    sub.add_argument(
        "--link", metavar="URL", help="serve what came from the board here, for a ground station"
    )
    sub.add_argument("--speed", type=_positive, default=1.0, help="pace on --link (default 1)")

    sub = command(
        "emulate",
        "pretend to be a robot: an ArduPilot rover, or a motor controller of a robot file",
        "kmpc-bridge emulate mavlink --link tcp:127.0.0.1:5760",
    )
    sub.add_argument("robot", help="mavlink, or a robot file")
    sub.add_argument(
        "--link",
        metavar="URL",
        help="pty:PATH, tcp:HOST:PORT or udp:HOST:PORT; the robot file's where not given",
    )
    sub.add_argument("--scenario", help="start where this one starts, on its floor")
    sub.add_argument(
        "--start",
        nargs=3,
        type=float,
        metavar=("X", "Y", "THETA"),
        help="where it stands [m, m, rad]",
    )
    sub.add_argument(
        "--physics",
        choices=("slip", "mujoco"),
        default="slip",
        help="slip: a robot that slips at random (default); mujoco: the digital twin of a ROSbot 2, among the scenario's obstacles",
    )
    sub.add_argument("--slip", type=float, help="mean slip ratio of the floor")
    sub.add_argument("--turn-gain", type=float, help="share of a turn that happens")
    sub.add_argument("--seed", type=int, default=0, help="of the slip (default 0)")
    sub.add_argument(
        "--pose", metavar="URL", help="also be its motion capture: send poses to udp:HOST:PORT"
    )
    sub.add_argument(
        "--arm-after",
        type=float,
        default=2.0,
        help="arming is refused so long after boot [s] (default 2)",
    )
    sub.add_argument("--seconds", type=_positive, help="end after so long [s]")

    sub = command(
        "estop",
        "stop the robot that a running bridge drives, and keep it stopped",
        "kmpc-bridge estop",
    )
    what = sub.add_mutually_exclusive_group()
    what.add_argument(
        "--reset",
        dest="word",
        action="store_const",
        const="reset",
        help="clear the stop; the robot stays still",
    )
    what.add_argument(
        "--enable",
        dest="word",
        action="store_const",
        const="enable",
        help="let the robot drive (again)",
    )
    what.add_argument(
        "--confirm-frame",
        dest="word",
        action="store_const",
        const="confirm",
        help="after a restart of the autopilot: you have seen that the robot is shown where it is",
    )
    what.add_argument(
        "--status", dest="word", action="store_const", const="status", help="what the gate is doing"
    )
    sub.add_argument("--socket", metavar="PATH", help="of the bridge, where not the default")
    sub.set_defaults(word="stop")

    sub = command(
        "latency",
        "measure latency and jitter of every driver on emulated boards, over ptys",
        "kmpc-bridge latency --seconds 10",
    )
    sub.add_argument(
        "--seconds", type=_positive, default=10.0, help="for each row of the table [s] (default 10)"
    )
    sub.add_argument(
        "--drivers",
        nargs="+",
        choices=MEASURED,
        default=list(MEASURED),
        help="which (default all)",
    )
    sub.add_argument(
        "--rates",
        nargs="+",
        type=_positive,
        default=[10.0, 50.0],
        help="of plans and commands [Hz] (default 10 50)",
    )

    sub = command(
        "demo",
        "learn from a drive of the emulated rover, drive it past four obstacles over a pseudo-terminal, and show it",
        "kmpc-bridge demo --seconds 50 --output out",
    )
    sub.add_argument(
        "--seconds",
        type=_positive,
        default=50.0,
        help="of random driving to learn from [s] (default 50)",
    )
    sub.add_argument(
        "--seed",
        type=int,
        default=0,
        help="of the random driving and of the floor's slip (default 0)",
    )
    sub.add_argument(
        "--output",
        type=Path,
        default=Path("out"),
        help="folder for log, model, run and report (default out)",
    )
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"expected a number > 0, got {text}")
    return value


def _robot_options(sub: argparse.ArgumentParser) -> None:
    """Where the robot is and what it may do; each replaces a key of the robot file."""
    sub.add_argument(
        "robot", nargs="?", help="robot file (TOML); the options below replace its keys"
    )
    sub.add_argument("--driver", choices=DRIVERS, help="link.driver")
    sub.add_argument(
        "--link",
        metavar="URL",
        help="link.url: serial:PATH?baud=..., pty:PATH, tcp:HOST:PORT, udp:HOST:PORT",
    )
    sub.add_argument(
        "--pose",
        metavar="URL",
        help="link.pose: udp:HOST:PORT where motion capture sends `stamp x y theta` (ENU, m, rad)",
    )
    sub.add_argument(
        "--timeout", type=float, help="link.timeout: how long the board may take to answer [s]"
    )
    sub.add_argument(
        "--v-max", type=float, help="limits.v_max and v_reverse [m/s]; slow where not given"
    )
    sub.add_argument("--omega-max", type=float, help="limits.omega_max [rad/s]")
    sub.add_argument(
        "--geofence",
        nargs=4,
        type=float,
        metavar=("XMIN", "YMIN", "XMAX", "YMAX"),
        help="safety.geofence [m]",
    )
    sub.add_argument("--socket", metavar="PATH", help="safety.socket: of the emergency stop")
    sub.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="any other key, in TOML: board.rate=50",
    )


def _drive_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--arm",
        action="store_true",
        help="arm an autopilot and choose GUIDED; else the pilot does both",
    )
    sub.add_argument("--period", type=float, help="control.period [s]; the model's where not given")
    sub.add_argument(
        "--command-period",
        type=float,
        help="control.command_period: of commands on the wire [s] (default 0.02)",
    )
    sub.add_argument(
        "--realtime",
        action="store_true",
        help="ask for real-time priority, and say what was not permitted",
    )
    sub.add_argument(
        "--latency",
        type=float,
        help="control.latency: from the wire to the wheels [s] (default 0; 0.2 of an autopilot with a model without lags)",
    )
