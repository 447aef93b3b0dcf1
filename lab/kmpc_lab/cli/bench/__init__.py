"""`kmpc bench`: step times on this machine, beside whichever peers are installed."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from kmpc_lab.cli.bench.jobs import BESIDE, COMPARISON, DRIVES, JOBS, LOOP, SECONDS, STEPS
from kmpc_lite.cli.command import Command, refuse_unread
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import count, positive

SHARED = ("--drives", "--tuning", "--only", "--picture", "--seconds", "--no-load", "--budget")
"""Options that not every job reads."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    text = f"recorded drives of {STEPS} states (default: {DRIVES})"
    add("--drives", type=count, metavar="N", help=text)
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    text = "time only contenders whose names contain one of these words"
    add("--only", nargs="+", metavar="WORD", help=text)
    add("--picture", type=Path, metavar="FILE", help="picture of the distributions to write (.png)")
    what = parser.add_mutually_exclusive_group()
    for option, job in JOBS.items():
        what.add_argument(option, dest="job", action="store_const", const=option, help=job.text)
    what.add_argument("--beside", nargs="+", type=Path, metavar="FILE", help=BESIDE.text)
    what.add_argument("--loop", type=positive, metavar="HZ", help=LOOP.text)
    text = f"with --loop: for how long [s] (default: {SECONDS:g})"
    add("--seconds", type=positive, metavar="S", help=text)
    add("--no-load", action="store_true", help="with --loop: leave the other cores alone")
    add(
        "--budget", type=positive, metavar="S", help="with --loop: the controller's time_budget [s]"
    )


def run(options: argparse.Namespace) -> int:
    """Measure what was asked for."""
    name, job = options.job, JOBS.get(options.job, COMPARISON)
    if options.loop:
        name, job = "--loop", LOOP
    elif options.beside:
        name, job = "--beside", BESIDE
    who = " ".join(filter(None, ("kmpc bench", name)))
    refuse_unread("kmpc bench", who, options, SHARED, job.reads)
    if options.picture:
        need("--picture", "matplotlib")
    told, text = job.measure(options)
    print(json.dumps(told) if options.json else text)
    return 0


COMMAND = Command(
    text="Time a step on this machine, beside the peers that are installed, on the same states.",
    examples=(
        "kmpc bench",
        "kmpc bench --drives 40 --picture bench.png",
        "kmpc bench --cold",
        "kmpc bench --solvers",
        "kmpc bench --json > pi5.json           # on each board; then, anywhere:",
        "kmpc bench --beside pi5.json pc.json",
        "kmpc bench --loop 100 --seconds 600",
        "kmpc bench --quality",
        "kmpc bench --fit",
    ),
    add_options=add_options,
    run=run,
)
