"""`kmpc replay`: summarise a recorded tlog, or make a CSV of it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from firmware_bridge.messages import BridgeError
from kmpc_lite.cli.command import Command, need, positive


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("log", help="NAME.tlog")
    add("--csv", metavar="FILE", help="write the poses and measured speeds as a log for kmpc fit")
    text = "time between the CSV's rows [s] (default: 0.1)"
    add("--period", type=positive, metavar="S", default=0.1, help=text)
    add("--system", type=int, default=1, help="MAVLink id of the vehicle (default: 1)")


def run(options: argparse.Namespace) -> int:
    """Do what was asked with a log, and print what it holds."""
    from firmware_bridge.recording.replay import replay

    log = Path(options.log)
    need(f"{log}: a tlog", "pymavlink")
    report = replay(log, options.csv, options.period, options.system)
    if options.json:
        print(json.dumps(report))
        return 0
    for key, value in report.items():
        print(f"{key:<12}{json.dumps(value) if isinstance(value, dict | list) else value}")
    return 0


COMMAND = Command(
    text="Summarise a recorded tlog, or make a CSV of it.",
    examples=("kmpc replay drive.tlog", "kmpc replay drive.tlog --csv drive.csv"),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
