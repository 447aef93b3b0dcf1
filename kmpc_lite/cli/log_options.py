"""Options of every command that reads logs: how a log is to be understood."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kmpc_lite.cli.command import positive
from kmpc_lite.errors import DataError

if TYPE_CHECKING:
    from kmpc_lite.learn.logs import ReadOptions

LOGS = (
    "tables (.csv, .tsv, .txt, .npz with t,x,y,theta,v,omega, lat,lon or left,right), ROS bags "
    "(rosbag2 folder, .mcap, .db3, .bag), ArduPilot .bin and .tlog, PX4 .ulg, TUM and EuRoC "
    "trajectories; or a folder of them"
)
_TEXTS = {
    "--columns": "columns of tables: t=stamp theta=yaw",
    "--topics": "topics of a bag, or messages of an autopilot: odom=/odom cmd=/cmd_vel",
    "--units": "units of columns: t=ns theta=deg v=km/h; theta=-deg+90 is a compass heading",
    "--frame": "ned: x north, y east, theta clockwise; swapped: x and y exchanged (default: enu)",
    "--commands": "table with t, v, omega for trajectories that have none",
    "--track": "distance between left and right wheels, if the commands are their speeds",
    "--wheel-radius": "of the wheels, if their speeds are turns: --units left=rpm right=rpm",
    "--wheelbase": "distance between a car's axles, if the commands are steering angles (default: "
    "found)",
    "--shift": "shift the commands in time if their clock differs [s]",
}


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add LOG and what tells how it is to be read."""
    parser.add_argument("log", type=Path, nargs="+", metavar="LOG", help=LOGS)
    group = parser.add_argument_group("how logs are read")

    def add(name: str, **how: Any) -> None:
        group.add_argument(name, help=_TEXTS[name], **how)

    for name in ("--columns", "--topics", "--units"):
        words = "COLUMN=UNIT" if name == "--units" else "OURS=THEIRS"
        add(name, nargs="+", default=[], metavar=words)
    add("--frame", default="enu", metavar="enu|ned|swapped")
    add("--commands", type=Path, metavar="FILE")
    for name in ("--track", "--wheel-radius", "--wheelbase"):
        add(name, type=positive, metavar="M")
    add("--shift", type=float, default=0.0, metavar="S")


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add the word that learns from a suspect log."""
    parser.add_argument(
        "--force", action="store_true", help="learn even if something in the logs is suspect"
    )


def read_options(options: argparse.Namespace) -> ReadOptions:
    """Put together what the command line says of the logs.

    Raises DataError for what cannot be understood.
    """
    from kmpc_lite.cli.output import ProgressBar
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
