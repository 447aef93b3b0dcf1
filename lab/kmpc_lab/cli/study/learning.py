"""`kmpc study learning`: what the default fit is worth, on logs, lagging and nominal robots."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("log", type=Path, nargs="*", help="logs of real robots, ten splits each")
    add("--robots", type=count, default=200, help="number of nominal robots (default: 200)")
    add("--lagging", type=count, default=10, help="number of lagging robots (default: 10)")


def run(options: argparse.Namespace) -> int:
    """Fit, judge on what nothing was fitted to, print the shares of the nominal robot's errors."""
    from kmpc_lab.studies.learning import (
        format_harm,
        format_ratios,
        study_lagging,
        study_log,
        study_nominal,
    )

    told, texts = {}, []
    for log in options.log:
        rows, noise = study_log(log, ProgressBar(log.stem, quiet=options.json))
        told[log.stem] = {"splits": [r.as_dict() for r in rows], "noise": noise.as_dict()}
        texts += [format_ratios(log.stem, rows), f"{log.stem}: {noise}"]
    lagging = study_lagging(ProgressBar("lagging robots", quiet=options.json), options.lagging)
    nominal = study_nominal(ProgressBar("nominal robots", quiet=options.json), options.robots)
    texts += [
        format_ratios("lagging robots, by the true pose", lagging),
        format_harm(nominal),
    ]
    told["lagging"] = {"robots": [r.as_dict() for r in lagging]}
    told["nominal"] = {"robots": [r.as_dict() for r in nominal]}
    print(json.dumps(told) if options.json else "\n".join(texts))
    return 0


COMMAND = Command(
    text="Errors of the default fit after 1 s as shares of the nominal robot's, on driving that "
    "nothing was fitted to.",
    examples=("kmpc study learning husky.csv warthog.csv",),
    add_options=add_options,
    run=run,
)
