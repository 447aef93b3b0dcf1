"""`kmpc study` of robots: without tuning, cars that park, made from a real log."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kmpc_lab.cli.study.command import chosen, study
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import count, positive

if TYPE_CHECKING:
    from kmpc_lab.studies.records import Work

STUDIES = {
    "anyrobot": "Robots drawn at random from a seed: size, speed, period, lag, slip, turning "
    "centre, noise and, of one in three, a footprint; cars and omnis by --wheels. Each is learned "
    "from its own log and drives a map of its size.",
    "scales": "The standard robot at six scales, and robots of other numbers: Husky-like, "
    "Warthog-like, micro, forward only, slow to turn, fast; learned from one minute of poses that "
    "err by 2 cm and 3 degrees; with ramps; at a period of 1 s and horizons of 10, 20 and 40.",
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
    add(
        "--wheels",
        nargs="+",
        choices=("differential", "car", "omni", "twin-car", "twin-omni"),
        default=["differential"],
        help="anyrobot: what is drawn (default: differential); twin-: the digital twin's",
    )
    add("--only", nargs="+", metavar="WORD", help="robots whose names contain one of these words")


def run(options: argparse.Namespace, work: Work, name: str) -> tuple[Any, str, bool]:
    """Drive the robots of a study."""
    from kmpc_lab.studies import robot_drives
    from kmpc_lab.studies.any_robot import KNOWN, ODD, SCALES, STANDARD, scaled

    seeds = range(options.seed, options.seed + options.drives)
    if name == "anyrobot":
        if any(kind.startswith("twin-") for kind in options.wheels):
            need("the digital twin", "mujoco")
        rows = robot_drives.study_random(seeds, not options.round, options.wheels, work)
    else:
        at_scales = (scaled(STANDARD, by) for by in SCALES)
        robots = {robot.name: robot for robot in (*at_scales, *KNOWN, *ODD)}
        asked = [robots[name] for name in chosen(robots, options.only)]
        rows = robot_drives.study(name, asked, seeds, work)
    return list(map(asdict, rows)), robot_drives.format_rows(rows), False


def add_parking_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run_parking` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=20, metavar="N", help="cars, each in a scene of every kind")
    add("--seed", type=int, default=2000, metavar="S", help="seed of the first car (default: 2000)")
    add("--only", nargs="+", metavar="WORD", help="kinds whose names contain one of these words")


def run_parking(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
    """Park cars; it must not happen that one touches anything."""
    from kmpc_lab.studies.parking import drives
    from kmpc_lab.studies.parking.scenes import KINDS

    seeds = range(options.seed, options.seed + options.drives)
    rows = drives.study(chosen(KINDS, options.only), seeds, work)
    bad = any(row.collided for row in rows)
    return list(map(asdict, rows)), drives.format_rows(rows), bad


def add_real_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run_real` reads."""
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


def run_real(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
    """Drive every model over the same maps."""
    from kmpc_lab.studies import real_robots
    from kmpc_lab.studies.robot_drives import format_rows

    names = chosen([recipe.name for recipe in real_robots.RECIPES], options.models, "--models")
    recipes = [recipe for recipe in real_robots.RECIPES if recipe.name in names]
    real = real_robots.real_robot(options.log, options.radius, options.speed, options.turn_rate)
    real.halves()  # an unreadable log is reported before any work
    seeds = range(options.seed, options.seed + options.maps)
    rows = real_robots.study(real, recipes, seeds, work)
    margins = real_robots.widths(real)
    told = {"margins": list(map(asdict, margins)), "drives": list(map(asdict, rows))}
    text = "\n".join([real_robots.WIDTHS, *map(str, margins), "", format_rows(rows)])
    return told, text, False


COMMANDS = {
    name: study(name, text, add_options, partial(run, name=name)) for name, text in STUDIES.items()
}
PARKING = study(
    "parking",
    "Cars of any size, speed and turning radius park in bays and along kerbs, leave dead ends, "
    "turn round in lanes and drive in the open: time against the shortest curve of Reeds and "
    "Shepp, changes of gear, and touches by the exact outline.",
    add_parking_options,
    run_parking,
    ("kmpc study parking --drives 10", "kmpc study parking --only open gap"),
)
REAL = study(
    "real",
    "Drives of a plant made from one half of a real log, with models learned from the other "
    "half: with and without lags, with and without adaptation.",
    add_real_options,
    run_real,
    (
        "kmpc study real husky.csv --radius 0.5 --speed 1 --turn-rate 1",
        "kmpc study real husky.csv --radius 0.5 --speed 1 --turn-rate 1 --models auto --maps 20",
    ),
)
