"""Options of every command that reads logs: how a log is to be understood."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from kmpc_lite.cli.numbers import positive
from kmpc_lite.errors import DataError

if TYPE_CHECKING:
    from kmpc_lite.learn.logs import ReadOptions

LOGS = (
    "tables (.csv, .tsv, .txt, .npz with t,x,y,theta,v,omega, lat,lon or left,right), ROS bags "
    "(rosbag2 folder, .mcap, .db3, .bag), ArduPilot .bin and .tlog, PX4 .ulg, TUM and EuRoC "
    "trajectories; or a folder of them"
)


def add_log_options(parser: argparse.ArgumentParser) -> None:  # long: a list of options
    """Add LOG and what tells how it is to be read."""
    add = parser.add_argument
    add("log", type=Path, nargs="+", metavar="LOG", help=LOGS)
    group = parser.add_argument_group("how logs are read")
    add = group.add_argument
    add(
        "--columns",
        nargs="+",
        default=[],
        metavar="OURS=THEIRS",
        help="columns of tables: t=stamp theta=yaw",
    )
    add(
        "--topics",
        nargs="+",
        default=[],
        metavar="OURS=THEIRS",
        help="topics of a bag, or messages of an autopilot: odom=/odom cmd=/cmd_vel",
    )
    add(
        "--units",
        nargs="+",
        default=[],
        metavar="COLUMN=UNIT",
        help="units of columns: t=ns theta=deg v=km/h; theta=-deg+90 is a compass heading",
    )
    add(
        "--frame",
        default="enu",
        metavar="enu|ned|swapped",
        help="ned: x north, y east, theta clockwise; swapped: x and y exchanged (default: enu)",
    )
    add(
        "--commands",
        type=Path,
        metavar="FILE",
        help="table with t, v, omega for trajectories that have none",
    )
    add(
        "--track",
        type=positive,
        metavar="M",
        help="distance between left and right wheels, if the commands are their speeds",
    )
    add(
        "--wheel-radius",
        type=positive,
        metavar="M",
        help="of the wheels, if their speeds are turns: --units left=rpm right=rpm",
    )
    add(
        "--wheelbase",
        type=positive,
        metavar="M",
        help="distance between a car's axles, if the commands are steering angles (default: found)",
    )
    add(
        "--shift",
        type=float,
        default=0.0,
        metavar="S",
        help="shift the commands in time if their clock differs [s]",
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add the word that learns from a suspect log."""
    parser.add_argument(
        "--force", action="store_true", help="learn even if something in the logs is suspect"
    )


def read_options(options: argparse.Namespace) -> ReadOptions:
    """Put together what the command line says of the logs.

    Raises
    ------
    DataError
        For what cannot be understood.
    """
    from kmpc_lite.cli.progress import ProgressBar
    from kmpc_lite.learn.logs import ReadOptions

    return ReadOptions(
        columns=pairs("--columns", options.columns),
        topics=pairs("--topics", options.topics),
        units=pairs("--units", options.units),
        frame=options.frame,
        commands=options.commands,
        track=options.track,
        wheelbase=options.wheelbase,
        wheel_radius=options.wheel_radius,
        shift=options.shift,
        force=getattr(options, "force", False),
        progress=ProgressBar("reading", quiet=options.json),
    )


def pairs(option: str, words: list[str]) -> dict[str, str]:
    """Read words like ``theta=yaw``."""
    found: dict[str, str] = {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign or not name or not value:
            raise DataError(f"{option}: expected words such as theta=yaw, got {word!r}")
        if name in found:
            raise DataError(f"{option}: {name} is given twice")
        found[name] = value
    return found
