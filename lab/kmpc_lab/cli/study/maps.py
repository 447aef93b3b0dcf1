"""`kmpc study maps` and the other studies over random maps: lag, noise, turning, and so on."""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import kmpc_lite as kl
from kmpc_lab.studies.options import add_runner, runner
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar

if TYPE_CHECKING:
    from kmpc_lab.studies.contenders import Contender
    from kmpc_lab.studies.records import Record

FAMILIES = {
    "open": "4 to 9 circles",
    "dense": "10 to 14 circles",
    "narrow": "10 to 14 circles, a passage of 6 cm",
    "trap": "a U that opens towards the start",
    "corridor": "walls of circles with one gap each",
    "moving": "circles that cross",
    "polygons": "polygons and some circles",
    "walls": "4 to 7 walls",
    "rooms": "a house as an occupancy grid",
}
"""Families of random maps; `kmpc_lab.sim.maps.families` draws them."""
STUDIES = {
    "maps": "Random maps by families and slips, driven by IPOPT and by ours.",
    "lag": "Robots whose motors lag, with models of their logs; exact, noisy and old poses.",
    "noise": "Noisy poses, and old ones.",
    "turning": "Robots that turn about a point centimetres from the one that is tracked.",
    "adaptation": "A floor that changes after a second, with and without adaptation.",
    "mismatch": "Models learned at another slip than the one that is driven at.",
}
"""Studies over random maps; `kmpc_lab.studies.conditions` says what each drives."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--maps", type=count, default=100, metavar="N", help="maps of each family (default: 100)")
    add(
        "--families",
        nargs="+",
        choices=tuple(FAMILIES),
        metavar="FAMILY",
        default=["open"],
        help="families of random maps (default: open)\n"
        + "\n".join(f"{name}: {text}" for name, text in FAMILIES.items()),
    )
    add(
        "--slips",
        type=float,
        nargs="+",
        metavar="SLIP",
        help="mean slip ratios (default: the study's)",
    )
    add(
        "--controllers",
        nargs="+",
        metavar="WORD",
        help="controllers whose labels contain one of these (default: the study's)",
    )
    add(
        "--trained-at",
        type=float,
        metavar="SLIP",
        help="slip at which models are learned (default: the one driven at; mismatch: 0.1)",
    )
    add("--failures", type=Path, metavar="DIR", help="scenario files of drives that failed")
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    add_runner(parser)


def run(options: argparse.Namespace, name: str) -> int:
    """Drive random maps under the conditions of a study."""
    from kmpc_lab.studies.conditions import STUDIES as CATALOGUE
    from kmpc_lab.studies.conditions import choose
    from kmpc_lab.studies.random_maps import maps_study
    from kmpc_lab.studies.tables import format_maps, summarise
    from kmpc_lab.studies.training import DT, REPORTING_SEED
    from kmpc_lite.scenario.files import Scenario

    study = CATALOGUE[name]
    specs = choose(study, options.controllers)
    for spec in specs:
        # what is missing is reported now, not after minutes of training
        spec.build(kl.nominal_unicycle(DT), Scenario.load("mehrez"))
    bar = ProgressBar(name, quiet=options.json)
    with runner(options) as executor:
        records = maps_study(
            specs,
            executor,
            families=options.families,
            slips=tuple(options.slips or study.slips),
            maps=options.maps,
            first_seed=0 if options.tuning else REPORTING_SEED,
            records=options.records,
            failures=options.failures,
            trained_at=study.trained_at if options.trained_at is None else options.trained_at,
            conditions=study.conditions,
            progress=bar,
        )
    rows = summarise(records)
    if options.json:
        print(json.dumps([row.as_dict() for row in rows]))
    else:
        print(format_maps(rows) + _time_to_pose(records, specs))
    return 0


def _time_to_pose(records: list[Record], specs: list[Contender]) -> str:
    """Tell how much longer ours takes than the paper's controller, where both drove; or nothing."""
    from kmpc_lab.studies.tables import time_ratio

    ours, reference = specs[-1].label, "K-NMPC, IPOPT"
    if ours == reference or reference not in (spec.label for spec in specs):
        return ""
    both, ratio = time_ratio(records, ours, reference)
    told = "-" if ratio is None else f"{ratio:.3f}"
    drives = f"on the {both} drives where both arrive"
    return f"\ntime to the pose, {ours} to {reference}, {drives}: {told}"


def _examples(name: str) -> tuple[str, ...]:
    some = f"kmpc study {name} --maps 10 --families dense trap --slips 0.1"
    return some, f"kmpc study {name} --records {name}.jsonl --failures failures"


COMMANDS = {
    name: Command(
        text=text,
        examples=_examples(name),
        add_options=add_options,
        run=partial(run, name=name),
    )
    for name, text in STUDIES.items()
}
