"""`kmpc study table1`: the paper's table 1, its controllers beside ours."""

from __future__ import annotations

import argparse
import json

import kmpc_lite as kl
from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add(
        "--trials",
        type=count,
        default=5,
        metavar="N",
        help="runs per cell (default: 5, as in the paper)",
    )
    add(
        "--scenario",
        default="four_circles_1",
        metavar="NAME",
        help="map (default: four_circles_1); its slip and seed are replaced",
    )
    add_runner(parser)


def run(options: argparse.Namespace) -> int:
    """Drive all cells and print the table."""
    from kmpc_lab.studies.contenders import TABLE_1_CONTENDERS
    from kmpc_lab.studies.table1 import format_table1, table1
    from kmpc_lab.studies.training import DT
    from kmpc_lite.scenario.files import Scenario

    scenario = Scenario.load(options.scenario)
    for row in TABLE_1_CONTENDERS:
        # what is missing is reported now, not after minutes of training
        row.build(kl.nominal_unicycle(DT), scenario)
    bar = ProgressBar("table 1", quiet=options.json)
    with runner(options) as executor:
        cells = table1(scenario, executor, options.trials, progress=bar, records=options.records)
    print(json.dumps([c.as_dict() for c in cells]) if options.json else format_table1(cells))
    return 0


COMMAND = Command(
    text="The paper's table 1 beside ours. The rows of IPOPT need the extra peers.",
    examples=("kmpc study table1", "kmpc study table1 --trials 100 --json > table1.json"),
    add_options=add_options,
    run=run,
)
