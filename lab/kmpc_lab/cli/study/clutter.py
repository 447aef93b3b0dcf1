"""`kmpc study clutter`: its options, and what runs it."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kmpc_lab.cli.study.command import first_seed, study
from kmpc_lite.cli.numbers import count

if TYPE_CHECKING:
    from kmpc_lab.studies.records import Work

CONDITIONS = {
    "exact": "as in Gazebo: 2 mm, 0.1 degrees, ranges 1 mm",
    "noisy": "1 cm, 0.5 degrees, ranges 1 cm",
    "late": "exact, but 50 ms old without a driver knowing it; odometry drifts by 15 mm a metre",
}
"""How well poses and ranges are measured; `kmpc_lab.studies.clutter.drives` has the same."""
DRIVERS = "ours", "dwa", "pursuit"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=50, metavar="N", help="worlds (default: 50)")
    add("--repeats", type=count, default=1, metavar="N", help="drives of each (default: 1)")
    add(
        "--conditions",
        nargs="+",
        choices=tuple(CONDITIONS),
        metavar="NAME",
        default=["exact", "noisy"],
        help="poses and scans (default: exact noisy)\n"
        + "\n".join(f"{name}: {text}" for name, text in CONDITIONS.items()),
    )
    add(
        "--drivers",
        nargs="+",
        choices=DRIVERS,
        metavar="NAME",
        default=list(DRIVERS),
        help="ours, dwa, pursuit (default: all)",
    )
    add("--moving", action="store_true", help="cylinders that move, like DynaBARN's")
    add(
        "--barn",
        type=Path,
        metavar="DIR",
        help="folder of the public set's worlds (world_N.world, and path_N.npy if there), "
        "used instead",
    )
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")


def run(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
    """Drive the worlds; it must not happen that ours touches cylinders at rest."""
    from kmpc_lab.studies.clutter import drives
    from kmpc_lite.errors import ScenarioError

    if options.barn is not None:
        if options.moving or options.drives > drives.PUBLIC:
            raise ScenarioError(
                f"--barn: expected at most {drives.PUBLIC} worlds, and no --moving beside it"
            )
        seeds = range(0, options.drives * (step := drives.PUBLIC // options.drives), step)
    else:
        first = first_seed(options)
        seeds = range(first, first + options.drives)
    rows = drives.study(
        *(work, seeds, options.conditions, options.drivers, options.moving),
        str(options.barn.absolute()) if options.barn else "",
        options.repeats,
    )
    bad = not options.moving and any(row.collided for row in rows if row.axes[1] == "ours")
    return list(map(asdict, rows)), drives.format_rows(rows, not options.moving), bad


CLUTTER = study(
    "clutter",
    "Fields of cylinders in the manner of the BARN challenge, driven by a Jackal-like robot by "
    "lidar alone, beside a dynamic window and pure pursuit: a kinematic replica, no Gazebo score.",
    add_options,
    run,
    (
        "kmpc study clutter --drives 10 --drivers ours dwa",
        "kmpc study clutter --barn the-barn-challenge/jackal_helper/worlds/BARN",
    ),
)
