"""`kmpc study sight`: worlds that the robot knows by its lidar alone."""

from __future__ import annotations

import argparse
import json

from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=10, metavar="N", help="worlds of each kind (default: 10)")
    add(
        "--seed",
        type=int,
        default=500_000,
        metavar="S",
        help="seed of the first world (default: 500000; below it was tuned)",
    )
    add("--kinds", nargs="+", metavar="KIND", help="of rooms, maze, forest (default: all)")
    add(
        "--reach",
        nargs="+",
        type=float,
        metavar="M",
        help="how far the lidar sees [m] (default: 2 4 8)",
    )
    add("--robots", nargs="+", metavar="NAME", help="standard, Husky-like (default: both)")
    add(
        "--circles",
        action="store_true",
        help="instead: circles reported within 2, 1, 0.5 and 0.3 m",
    )
    add_runner(parser)


def run(options: argparse.Namespace) -> int:
    """Drive the worlds."""
    from kmpc_lab.studies.sight import circles, table
    from kmpc_lab.studies.sight.drives import ROBOTS
    from kmpc_lab.studies.sight.worlds import KINDS
    from kmpc_lite.errors import ScenarioError, did_you_mean

    for given, known in ((options.kinds, KINDS), (options.robots, ROBOTS)):
        for name in given or ():
            if name not in known:
                hint = did_you_mean(name, known) or f"; expected one of {', '.join(known)}"
                raise ScenarioError(f"nothing named {name!r}{hint}")
    for reach in options.reach or ():
        if not 0.0 < reach < 1e3:
            raise ScenarioError(f"--reach: expected a distance above 0 m, got {reach:g}")
    seeds = range(options.seed, options.seed + options.drives)
    bar = ProgressBar("sight", quiet=options.json)
    with runner(options) as executor:
        if options.circles:
            found = circles.study(executor, seeds, bar, options.records)
            rows, text = [row.as_dict() for row in found], circles.format_reveals(found)
        else:
            drives = table.study(
                executor,
                seeds,
                options.kinds or tuple(KINDS),
                options.reach or (2.0, 4.0, 8.0),
                options.robots or tuple(ROBOTS),
                bar,
                options.records,
            )
            rows, text = [row.as_dict() for row in drives], table.format_rows(drives)
    print(json.dumps(rows) if options.json else text)
    return 0


COMMAND = Command(
    text="Rooms, mazes and forests driven by lidar alone, beside a lattice search with pure "
    "pursuit that sees the same.",
    examples=(
        "kmpc study sight --kinds maze --reach 4 --robots standard",
        "kmpc study sight --circles --drives 20",
    ),
    add_options=add_options,
    run=run,
)
