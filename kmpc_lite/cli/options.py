"""Options that several commands share: how logs are read, where to drive, and how."""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kmpc_lite.cli.command import number, positive
from kmpc_lite.errors import DataError, ScenarioError, did_you_mean
from kmpc_lite.reading import read_bytes
from kmpc_lite.scenario.overrides import WEIGHTS, DriveOverrides

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
POSE = ("X", "Y", "THETA")
COLUMNS = ["x", "y", "theta"]
DEGREES = "deg"
LARGEST_ROUTE = 2**20  # longest route file that is read [bytes]
FEWEST_OF_LOOP = 2
TURN_SHARE = 4.0  # of the turn rate [rad/s^2], for each m/s^2 of ``--max-acceleration``


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
    from kmpc_lite.cli.command import ProgressBar
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


def pose(words: Sequence[str]) -> tuple[float, float, float]:
    """Read x, y [m] and theta: radians, or degrees with the suffix ``deg``.

    Raises ArgumentTypeError for what is no number, and for radians of more than a turn.

    Examples
    --------
    >>> pose(["1", "2", "180deg"])
    (1.0, 2.0, 3.141592653589793)
    >>> pose(["1", "2", "90"])
    Traceback (most recent call last):
    argparse.ArgumentTypeError: theta 90 is more than a turn in radians; for degrees write 90deg
    """
    x, y = map(number, words[:2])
    if (text := words[2].strip()).endswith(DEGREES):
        return x, y, math.radians(number(text.removesuffix(DEGREES)))
    theta = number(text)
    if abs(theta) > math.tau:
        raise argparse.ArgumentTypeError(
            f"theta {text} is more than a turn in radians; for degrees write {text}{DEGREES}"
        )
    return x, y, theta


class PoseOption(argparse.Action):
    """Reads a pose, for a repeated option a list of them."""

    def __init__(
        self, option_strings: Sequence[str], dest: str, repeated: bool = False, help: str = ""
    ) -> None:
        super().__init__(option_strings, dest, nargs=3, metavar=POSE, help=help)
        self._repeated = repeated

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Take three words."""
        try:
            found = pose(values)
        except argparse.ArgumentTypeError as error:
            raise argparse.ArgumentError(self, str(error)) from None
        before = getattr(namespace, self.dest) or ()
        setattr(namespace, self.dest, [*before, found] if self._repeated else list(found))


def add_goal_options(add: Callable[..., object], without: str) -> None:
    """Add where to drive; `without` says what is driven on without a scenario."""
    text = (
        "goal [m, m, rad, or degrees as 90deg] instead of the scenario's, repeated for a "
        f"route;\nwithout a scenario, {without}"
    )
    add("--goal", action=PoseOption, repeated=True, help=text)
    text = "the goals, one after the other: a CSV with columns x, y, theta"
    add("--route", type=Path, metavar="FILE", help=text)
    add("--loop", action="store_true", help="begin anew after the last goal, until time is up")


def goals_of(options: argparse.Namespace) -> list[tuple[float, float, float]]:
    """Give the goals of a command line, none if the scenario's count.

    Raises ScenarioError: names the option, or file and line.
    """
    given = vars(options)
    goals, route = given.get("goal") or [], given.get("route")
    if goals and route is not None:
        raise ScenarioError(f"--route {route}: the goals are given already by --goal")
    if route is not None:
        goals = read_route(route)
    if goals and given.get("loop") and len(goals) < FEWEST_OF_LOOP:
        raise ScenarioError("--loop: expected at least 2 goals to drive to in turn, got 1")
    return goals


def read_route(path: Path) -> list[tuple[float, float, float]]:
    """Read the goals of a CSV file with the columns x, y, theta.

    Raises ScenarioError: names the file and the line.
    """
    try:
        rows = csv.reader(read_bytes(path, LARGEST_ROUTE).decode("utf-8-sig").splitlines())
        table = [(line, row) for line, row in enumerate(rows, 1) if any(map(str.strip, row))]
    except OSError as error:
        raise ScenarioError(f"{path}: cannot read the route: {error.strerror or error}") from error
    except (ValueError, csv.Error) as error:
        raise ScenarioError(f"{path}: not CSV: {error}") from error
    if not table or [name.strip() for name in table[0][1]] != COLUMNS:
        raise ScenarioError(f"{path}: line 1: expected the columns x,y,theta")
    goals = []
    for line, row in table[1:]:
        try:
            if len(row) != len(COLUMNS):
                raise ValueError(f"expected 3 values, got {len(row)}")
            goals.append(pose(row))
        except (ValueError, argparse.ArgumentTypeError) as error:
            raise ScenarioError(f"{path}: line {line}: {error}") from None
    if not goals:
        raise ScenarioError(f"{path}: expected at least one goal")
    return goals


def add_clearance(add: Callable[..., object]) -> None:
    """Add how close the robot may come."""
    text = (
        "distance to keep from obstacles beyond the radii [m]; the model's uncertainty adds to it"
    )
    add("--clearance", "--margin", dest="margin", type=number, metavar="M", help=text)


def drive_overrides(options: argparse.Namespace, tuning: Sequence[str]) -> DriveOverrides:
    """Give what a command line asks for; `tuning` are its ``--set`` of the controller."""
    radius = vars(options).get("radius")
    return DriveOverrides(goals_of(options), options.loop, options.margin, radius, tuning)


def split_settings(items: Sequence[str], sections: Sequence[str]) -> tuple[list[str], list[str]]:
    """Tell what is a robot file's (its sections) from what is the controller's (its groups).

    Raises ScenarioError for a name that is neither.
    """
    from dataclasses import fields

    from kmpc_lite.control.options import ControllerOptions

    groups = [WEIGHTS, *(field.name for field in fields(ControllerOptions))]
    own: list[str] = []
    tuning: list[str] = []
    for item in items:
        name = item.partition("=")[0].partition(".")[0].strip()
        if name not in (*sections, *groups):
            expected = f"; expected one of {', '.join((*sections, *groups))}"
            raise ScenarioError(
                f"--set {item}: no group or section named {name!r}"
                f"{did_you_mean(name, [*groups, *sections]) or expected}"
            )
        (tuning if name in groups else own).append(item)
    return own, tuning
