"""`kmpc study real`: drives of a plant made from one half of a real log, learned from the other."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from kmpc_lab.cli.study.named import chosen
from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count, positive
from kmpc_lite.cli.progress import ProgressBar


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("log", type=Path, help="log of a real robot")
    add("--radius", type=positive, required=True, metavar="M", help="radius of the robot")
    add("--speed", type=positive, required=True, metavar="M/S", help="its largest speed")
    add("--turn-rate", type=positive, required=True, metavar="RAD/S", help="its largest turn rate")
    add("--maps", type=count, default=100, metavar="N", help="maps of each model (default: 100)")
    add("--seed", type=int, default=300, metavar="S", help="seed of the first map (default: 300)")
    add(
        "--models",
        nargs="+",
        metavar="WORD",
        help="only those whose names contain one of these words",
    )
    add_runner(parser)


def run(options: argparse.Namespace) -> int:
    """Drive every model over the same maps."""
    from kmpc_lab.studies.real_robots import RECIPES, WIDTHS, real_robot, study, widths
    from kmpc_lab.studies.robot_drives import format_rows

    names = chosen([recipe.name for recipe in RECIPES], options.models, "--models")
    recipes = [recipe for recipe in RECIPES if recipe.name in names]
    real = real_robot(options.log, options.radius, options.speed, options.turn_rate)
    real.halves()  # an unreadable log is reported before any work
    seeds = range(options.seed, options.seed + options.maps)
    bar = ProgressBar("real", quiet=options.json)
    with runner(options) as executor:
        rows = study(real, recipes, seeds, executor, bar, options.records)
    margins = widths(real)
    if options.json:
        told = {"margins": [asdict(w) for w in margins], "drives": [r.as_dict() for r in rows]}
        print(json.dumps(told))
    else:
        print("\n".join([WIDTHS, *map(str, margins), "", format_rows(rows)]))
    return 0


COMMAND = Command(
    text="Drives of a plant made from one half of a real log, with models learned from the other "
    "half: with and without lags, with and without adaptation.",
    examples=(
        "kmpc study real husky.csv --radius 0.5 --speed 1 --turn-rate 1",
        "kmpc study real husky.csv --radius 0.5 --speed 1 --turn-rate 1 --models auto --maps 20",
    ),
    add_options=add_options,
    run=run,
)
