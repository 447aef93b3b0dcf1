"""`kmpc record`: record a drive to learn from, by hand or at random inside a fence."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from firmware_bridge.cli.options import (
    add_drive_options,
    add_robot_options,
    people,
    prepare,
    read_robot,
)
from firmware_bridge.messages import BridgeError, ConfigError
from kmpc_lite.cli.command import Command, positive

if TYPE_CHECKING:
    from firmware_bridge.messages import Speeds
    from firmware_bridge.runtime.record_drive import Covered, Meter

PERIOD = 0.1  # of the rows where the robot file has none [s]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_robot_options(parser)
    add_drive_options(parser)
    add = parser.add_argument
    text = "record to NAME.csv, and of an autopilot to NAME.tlog"
    add("--output", required=True, metavar="NAME", help=text)
    how = parser.add_mutually_exclusive_group(required=True)
    how.add_argument(
        "--by-hand", action="store_true", help="a pilot drives; nothing is sent to the robot"
    )
    text = "drive at random inside the geofence: ahead and back, left and right"
    how.add_argument("--excite", action="store_true", help=text)
    text = "length of the recording [s] (default: 300)"
    add("--seconds", type=positive, metavar="S", default=300.0, help=text)
    text = (
        "with --excite: how long to wait for the vehicle before it drives [s] (default: as "
        "--seconds)"
    )
    add("--wait", type=positive, metavar="S", help=text)
    text = (
        "how long a random command is held [s] (default: as long as the robot takes to answer "
        "and to change its speed)"
    )
    add("--hold", type=positive, metavar="S", help=text)
    text = "with --excite: end as soon as the log shows all that a model needs"
    add("--until-covered", action="store_true", help=text)
    add("--seed", type=int, default=0, help="seed of the random commands (default: 0)")


def run(options: argparse.Namespace) -> int:
    """Record until the time is up, or a signal comes."""
    from firmware_bridge.runtime.record_drive import RandomDriving, record

    if options.until_covered and not options.excite:
        raise ConfigError("--until-covered: goes with --excite; whoever drives by hand decides")
    if options.wait is not None and not options.excite:
        raise ConfigError("--wait: goes with --excite; whoever drives by hand is not waited for")
    robot = read_robot(options)
    if options.by_hand and robot.sections.get("board", {}).get("arm"):
        raise ConfigError("--by-hand: the pilot arms and drives; leave board.arm and --arm out")
    prepare(options)
    period = robot.control.period or PERIOD
    driving = RandomDriving(options.hold, options.seed, options.until_covered)
    report, status = record(
        robot,
        options.output,
        options.seconds,
        period=period,
        excitation=None if options.by_hand else driving,
        out=people(options),
        meter=coverage_meter(period, robot.wheels.kind == "car"),
        wait=options.wait,
    )
    if options.json:
        print(json.dumps(report))
    return status


def coverage_meter(period: float, steered: bool = False) -> Meter:
    """The rule by which `kmpc fit` warns, for rows of so long a period [s], perhaps a car's."""
    import numpy as np

    from kmpc_lite.learn.coverage import find_coverage

    def meter(stretches: list[list[Speeds]], largest: tuple[float, float, float] | None) -> Covered:
        rows = [np.array(stretch)[:, :2] for stretch in stretches if stretch]
        return find_coverage(rows, period, largest, steered)

    return meter


COMMAND = Command(
    text="Record a drive to learn from: by hand, or at random inside a fence.",
    examples=(
        "kmpc record robot.toml --by-hand --output drive",
        "kmpc record robot.toml --excite --geofence -2 -2 2 2 --seconds 300 --output drive",
        "kmpc record robot.toml --excite --until-covered --geofence -2 -2 2 2 --output drive",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
