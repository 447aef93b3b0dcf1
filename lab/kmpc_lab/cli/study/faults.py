"""`kmpc study faults`: drives with forced failures."""

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
    add("--maps", type=count, default=100, metavar="N", help="number of maps (default: 100)")
    add(
        "--slips",
        type=float,
        nargs="+",
        metavar="SLIP",
        help="mean slip ratios (default: the study's)",
    )
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    add_runner(parser)


def run(options: argparse.Namespace) -> int:
    """Drive with forced failures; status 1 where something was seen that must not be."""
    from kmpc_lab.studies.faults import SLIPS, as_dicts, faults_study, format_faults
    from kmpc_lab.studies.training import REPORTING_SEED

    bar = ProgressBar("faults", quiet=options.json)
    with runner(options) as executor:
        rows = faults_study(
            executor,
            options.maps,
            tuple(options.slips or SLIPS),
            first_seed=0 if options.tuning else REPORTING_SEED,
            progress=bar,
            records=options.records,
        )
    print(json.dumps(as_dicts(rows)) if options.json else format_faults(rows))
    return int(any(row.bad for row in rows))


COMMAND = Command(
    text="Drives in which the solver, the clock, the warm start and the poses fail.",
    examples=("kmpc study faults --maps 10",),
    add_options=add_options,
    run=run,
)
