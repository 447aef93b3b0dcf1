"""`kmpc study anyrobot`, `scales` and `limits`: robots without tuning."""

from __future__ import annotations

import argparse
import json

from kmpc_lab.cli.study.named import chosen, named
from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar

STUDIES = {
    "anyrobot": "Robots drawn at random from a seed: size, speed, period, lag, slip, turning "
    "centre, noise and, of one in three, a footprint. Each is learned from its own log and drives "
    "a map of its size.",
    "scales": "The standard robot at six scales, and robots of other numbers: Husky-like, "
    "Warthog-like, micro, forward only, slow to turn, fast.",
    "limits": "The standard robot learned from one minute of poses that err by 2 cm and 3 degrees; "
    "and driven at a period of 1 s, at horizons of 10, 20 and 40.",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=40, metavar="N", help="robots, or maps of each robot")
    add(
        "--seed",
        type=int,
        default=2000,
        metavar="S",
        help="seed of the first robot (default: 2000)",
    )
    add("--round", action="store_true", help="anyrobot: round robots only, else drawn alike")
    add("--only", nargs="+", metavar="WORD", help="robots whose names contain one of these words")
    add_runner(parser)


def run(options: argparse.Namespace, name: str) -> int:
    """Drive the robots of a study."""
    from kmpc_lab.studies.any_robot import KNOWN, LIMITS, SCALES, STANDARD, scaled
    from kmpc_lab.studies.robot_drives import format_rows, study, study_random

    seeds = range(options.seed, options.seed + options.drives)
    bar = ProgressBar(name, quiet=options.json)
    with runner(options) as executor:
        if name == "anyrobot":
            rows = study_random(seeds, not options.round, executor, bar, options.records)
        else:
            at_scales = (*(scaled(STANDARD, by) for by in SCALES), *KNOWN)
            known = LIMITS if name == "limits" else at_scales
            robots = {robot.name: robot for robot in known}
            asked = [robots[name] for name in chosen(robots, options.only)]
            rows = study(name, asked, seeds, executor, bar, options.records)
    print(json.dumps([row.as_dict() for row in rows]) if options.json else format_rows(rows))
    return 0


COMMANDS = named(STUDIES, add_options, run)
