"""`kmpc study pedestrians` and `kmpc study jumps`: pedestrians, and pose jumps."""

from __future__ import annotations

import argparse
import json

from kmpc_lab.cli.study.named import chosen, named
from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar

STUDIES = {
    "pedestrians": "Drives among 4 or 8 pedestrians who ignore the robot, straight or in arcs; the "
    "controller is given their velocity, or zero, or zero with noise. Contacts are counted.",
    "jumps": "Drives whose pose jumps by 0.05 to 1 m or rad: for one sample, for a second, in "
    "heading, or with its frame for good.",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, default=100, metavar="N", help="drives of each row (default: 100)")
    add("--only", nargs="+", metavar="WORD", help="rows that are seen, or jump, in these ways")
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    add_runner(parser)


def run(options: argparse.Namespace, name: str) -> int:
    """Drive; status 1 if the robot drove into a pedestrian, or collided."""
    from kmpc_lab.studies import jumps, pedestrians
    from kmpc_lab.studies.training import REPORTING_SEED

    first = 0 if options.tuning else REPORTING_SEED
    bar = ProgressBar(name, quiet=options.json)
    with runner(options) as executor:
        if name == "jumps":
            kinds = chosen(jumps.KINDS, options.only)
            records = jumps.study(
                executor, options.drives, kinds, jumps.SIZES, first, bar, options.records
            )
        else:
            seen = chosen(pedestrians.SEEN, options.only)
            records = pedestrians.study(
                executor, options.drives, pedestrians.COUNTS, seen, first, bar, options.records
            )
    study = jumps if name == "jumps" else pedestrians
    print(json.dumps(study.rows(records)) if options.json else study.format_rows(records))
    return int(any(record.get("collided") or record.get("driven_into") for record in records))


COMMANDS = named(STUDIES, add_options, run)
