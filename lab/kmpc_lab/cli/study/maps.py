"""`kmpc study` over maps: the paper's table 1, random maps by conditions, forced failures."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import kmpc_lite as kl
from kmpc_lab.cli.study.command import add_slips, first_seed, study
from kmpc_lite.cli.numbers import count

if TYPE_CHECKING:
    from kmpc_lab.studies.contenders import Contender
    from kmpc_lab.studies.records import Record, Work
    from kmpc_lite.scenario.files import Scenario

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
}
"""Studies over random maps; `kmpc_lab.studies.conditions` says what each drives."""


def add_table_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run_table` reads."""
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


def run_table(options: argparse.Namespace, work: Work) -> tuple[Any, str, bool]:
    """Drive all cells of table 1."""
    from kmpc_lab.studies import contenders
    from kmpc_lab.studies.table1 import format_table1, table1
    from kmpc_lite.scenario.files import Scenario

    scenario = Scenario.load(options.scenario)
    _build(contenders.TABLE_1_CONTENDERS, scenario)
    cells = table1(scenario, work, options.trials)
    return [cell.as_dict() for cell in cells], format_table1(cells), False


def _build(specs: Sequence[Contender], scenario: Scenario) -> None:
    """Build each controller: what is missing is reported now, not after minutes of training."""
    from kmpc_lab.studies.training import DT

    for spec in specs:
        spec.build(kl.nominal_unicycle(DT), scenario)


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
        "--controllers",
        nargs="+",
        metavar="WORD",
        help="controllers whose labels contain one of these (default: the study's)",
    )
    add(
        "--trained-at",
        type=float,
        metavar="SLIP",
        help="slip at which models are learned (default: the one driven at)",
    )
    add("--failures", type=Path, metavar="DIR", help="scenario files of drives that failed")
    add_slips(parser)


def run(options: argparse.Namespace, work: Work, name: str) -> tuple[Any, str, bool]:
    """Drive random maps under the conditions of a study."""
    from kmpc_lab.studies.conditions import STUDIES as CATALOGUE
    from kmpc_lab.studies.conditions import choose
    from kmpc_lab.studies.random_maps import maps_study
    from kmpc_lab.studies.tables import format_maps, summarise
    from kmpc_lite.scenario.files import Scenario

    asked = CATALOGUE[name]
    specs = choose(asked, options.controllers)
    _build(specs, Scenario.load("mehrez"))
    records = maps_study(
        specs,
        work,
        families=options.families,
        slips=tuple(options.slips or asked.slips),
        maps=options.maps,
        first_seed=first_seed(options),
        failures=options.failures,
        trained_at=options.trained_at,
        conditions=asked.conditions,
    )
    rows = summarise(records)
    text = format_maps(rows) + _time_to_pose(records, specs)
    return [row.as_dict() for row in rows], text, False


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
    "table1": study(
        "table1",
        "The paper's table 1 beside ours. The rows of IPOPT need the extra peers.",
        add_table_options,
        run_table,
        ("kmpc study table1", "kmpc study table1 --trials 100 --json > table1.json"),
    ),
    **{
        name: study(name, text, add_options, partial(run, name=name), _examples(name))
        for name, text in STUDIES.items()
    },
}
