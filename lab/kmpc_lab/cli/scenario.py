"""The scenario of a command line: a file, one by its name, or a goal and obstacles alone."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from kmpc_lite.cli.command import positive
from kmpc_lite.cli.options import (
    TURN_SHARE,
    PoseOption,
    add_clearance,
    add_goal_options,
    drive_overrides,
)
from kmpc_lite.errors import ScenarioError
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.bundled import bundled
from kmpc_lite.scenario.overrides import drawn_table

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario

DEFAULT = "four_circles_1"


def add_scenario_options(parser: argparse.ArgumentParser) -> None:
    """Add what `read_scenario` reads."""
    add = parser.add_argument_group("scenario").add_argument
    text = (
        f"scenario file (.toml), or the name of one that comes along: {_names()} "
        f"(default: {DEFAULT})"
    )
    add("map", nargs="?", metavar="scenario", help=text)
    add("--scenario", metavar="NAME", help="the same, as an option")
    add_goal_options(add, "on an empty map")
    add("--start", action=PoseOption, help="start [m, m, rad, or degrees as 90deg]")
    add(
        "--obstacle",
        nargs="+",
        type=float,
        action="append",
        default=[],
        metavar=("X Y R", "VX VY"),
        help="one more circle [m], moving if a velocity is given [m/s]; repeatable",
    )
    add("--slip", type=float, help="mean slip ratio: drawn in every period; lengthens motion")
    add_clearance(add)
    text = "fastest change of the speed [m/s^2], and of the turn rate: 4 A [rad/s^2]"
    add("--max-acceleration", type=positive, metavar="A", help=text)
    text = "option of the controller, in TOML: margins.headway=0.2; repeatable"
    add("--set", action="append", default=[], metavar="GROUP.OPTION=VALUE", help=text)
    add("--seed", type=int, help="seed of the slip and of the noise of poses")
    text = "longest drive to each goal [s]: robots that turn slowly need more"
    add("--timeout", type=float, metavar="S", help=text)


def _names() -> str:
    """Names of the scenarios that come along, in short."""
    own = [name for name in bundled() if not name.startswith("twin_")]
    return f"{', '.join(own)}, and the maps of the digital twin, twin_a1 to twin_wet_patch"


def read_scenario(options: argparse.Namespace) -> Scenario:
    """Read the scenario, put the command line's values into it, and check it as a file would be.

    Raises ScenarioError: names the option, or file, section and key.
    """
    from kmpc_lite.scenario.files import Scenario

    named = options.map or options.scenario
    if options.map and options.scenario:
        raise ScenarioError(
            f"--scenario {options.scenario}: the scenario is given already: {options.map}"
        )
    for row in options.obstacle:
        if len(row) not in (3, 5):
            told = " ".join(f"{value:g}" for value in row)
            raise ScenarioError(f"--obstacle {told}: expected X Y R or X Y R VX VY")
    overrides = drive_overrides(options, options.set)
    goals = overrides.goals
    if named is None and not goals and (options.start or options.obstacle):
        raise ScenarioError("--start and --obstacle: give a --goal X Y THETA, or a scenario, too")
    if named is None and goals:
        start = options.start or (0.0, 0.0, 0.0)
        name, table = "command line", drawn_table(goals, start, options.obstacle)
    else:
        scenario = Scenario.load(named or DEFAULT)
        name, table = scenario.name, parse_toml(scenario.to_toml())
        table["map"]["circles"] += options.obstacle
        if options.start is not None:
            table["robot"]["start"] = options.start
    overrides.put(table)
    if (acceleration := options.max_acceleration) is not None:
        table["robot"]["du_max"] = [acceleration, TURN_SHARE * acceleration]
    for section, key in (("plant", "slip"), ("run", "seed"), ("run", "timeout")):
        if (value := getattr(options, key)) is not None:
            table.setdefault(section, {})[key] = value
    if (reach := getattr(options, "lidar", None)) is not None:
        table.setdefault("lidar", {})["reach"] = reach
    return Scenario.from_table(table, name, "command line")
