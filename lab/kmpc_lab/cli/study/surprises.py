"""`kmpc study` of what a robot did not know before: pedestrians, pose jumps, worlds by lidar."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from kmpc_lab.cli.study.command import add_tuning, chosen, first_seed, study
from kmpc_lite.cli.numbers import count

if TYPE_CHECKING:
    from kmpc_lab.studies.records import Work

STUDIES = {
    "pedestrians": "Drives among 4 or 8 pedestrians that ignore the robot, straight or in arcs; "
    "the controller is given their velocity, or zero, or zero with noise. Contacts are counted.",
    "jumps": "Drives whose pose jumps by 0.05 to 1 m or rad: for one sample, for a second, in "
    "heading, or with its frame for good.",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=100, metavar="N", help="drives of each row (default: 100)")
    add("--only", nargs="+", metavar="WORD", help="rows that are seen, or jump, in these ways")
    add_tuning(parser)


def run(options: argparse.Namespace, work: Work, name: str) -> tuple[Any, str, bool]:
    """Drive; it must not happen that the robot drives into a pedestrian, or collides."""
    from kmpc_lab.studies import jumps, pedestrians

    drives, first = options.drives, first_seed(options)
    if name == "jumps":
        kinds = chosen(jumps.KINDS, options.only)
        records = jumps.study(work, drives, kinds, first_seed=first)
        rows, text = jumps.rows(records), jumps.format_rows(records)
    else:
        seen = chosen(pedestrians.SEEN, options.only)
        records = pedestrians.study(work, drives, seen=seen, first_seed=first)
        rows, text = pedestrians.rows(records), pedestrians.format_rows(records)
    bad = any(record.get("collided") or record.get("driven_into") for record in records)
    return rows, text, bad


def add_sight_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run_sight` reads."""
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


def run_sight(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
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
    if options.circles:
        found = circles.study(work, seeds)
        return list(map(asdict, found)), circles.format_reveals(found), False
    kinds, robots = options.kinds or tuple(KINDS), options.robots or tuple(ROBOTS)
    drives = table.study(work, seeds, kinds, options.reach or (2.0, 4.0, 8.0), robots)
    return list(map(asdict, drives)), table.format_rows(drives), False


COMMANDS = {
    name: study(name, text, add_options, partial(run, name=name)) for name, text in STUDIES.items()
}
SIGHT = study(
    "sight",
    "Rooms, mazes and forests driven by lidar alone, beside a lattice search with pure "
    "pursuit that sees the same.",
    add_sight_options,
    run_sight,
    (
        "kmpc study sight --kinds maze --reach 4 --robots standard",
        "kmpc study sight --circles --drives 20",
    ),
)
