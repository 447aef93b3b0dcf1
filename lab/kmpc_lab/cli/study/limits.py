"""`kmpc study limits`: its options, and what runs it."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from kmpc_lab.cli.study.command import add_tuning, chosen, first_seed, study
from kmpc_lite.cli.numbers import count

if TYPE_CHECKING:
    from kmpc_lab.studies.records import Work


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=40, metavar="N", help="fields of each row (default: 40)")
    add("--only", nargs="+", metavar="WORD", help="robots whose names contain one of these words")
    add_tuning(parser)


def run(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
    """Drive the fields; it must not happen that a circle is touched."""
    from kmpc_lab.studies import accelerations

    names, first = chosen(accelerations.ROBOTS, options.only), first_seed(options)
    rows = accelerations.study(work, names, range(first, first + options.drives))
    bad = any(row.collided for row in rows)
    return list(map(asdict, rows)), accelerations.format_rows(rows), bad


LIMITS = study(
    "limits",
    "Robots of 0.3 to 4 m/s that change their speed by 0.3 to 5 m/s^2, in fields of circles: "
    "limits given or learned, all circles known or reported within 2 m. Time against the ideal "
    "with these accelerations, shares of statuses, and the change of commands.",
    add_options,
    run,
    ("kmpc study limits --drives 5", "kmpc study limits --only '3 m/s'"),
)
