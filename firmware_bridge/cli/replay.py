"""`kmpc replay`: summarise, convert, play back or mend a recorded log."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from firmware_bridge.messages import BridgeError, ConfigError
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import positive


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("log", help="NAME.tlog, NAME.raw or NAME.csv")
    add(
        "--mend",
        action="store_true",
        help="cut off the last row of NAME.csv if a power cut left it incomplete",
    )
    add(
        "--csv",
        metavar="FILE",
        help="write the poses and measured speeds of a tlog as a log for kmpc fit",
    )
    add(
        "--period",
        type=positive,
        metavar="S",
        default=0.1,
        help="time between the CSV's rows [s] (default: 0.1)",
    )
    add("--system", type=int, default=1, help="MAVLink id of the vehicle (default: 1)")
    add(
        "--link",
        metavar="URL",
        help="replay what the board sent on this link, for a ground station",
    )
    add(
        "--speed",
        type=positive,
        default=1.0,
        help="speed of the replay on --link, as a multiple of real time (default: 1)",
    )


def run(options: argparse.Namespace) -> int:
    """Do what was asked with a log, and print what it holds."""
    from firmware_bridge.recording.replay import inspect_csv, replay

    log = Path(options.log)
    if log.suffix == ".csv":
        if options.csv is not None or options.link is not None:
            raise ConfigError(f"{log}: --csv and --link take the .tlog or .raw log beside it")
        report = inspect_csv(log, options.mend)
    elif options.mend:
        raise ConfigError(
            f"{log}: --mend takes a .csv; a link log is read up to its last whole record as it is"
        )
    else:
        if log.suffix == ".tlog":
            need(f"{log}: a tlog", "pymavlink")
        report = replay(
            log, options.csv, options.period, options.system, options.link, options.speed
        )
    if options.json:
        print(json.dumps(report))
        return 0
    for key, value in report.items():
        print(f"{key:<12}{json.dumps(value) if isinstance(value, dict | list) else value}")
    return 0


COMMAND = Command(
    text="Summarise a recorded log, make a CSV of it, play it to a link, or mend it.",
    examples=(
        "kmpc replay drive.tlog",
        "kmpc replay drive.tlog --csv drive.csv",
        "kmpc replay drive.csv --mend        # after a power cut",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
