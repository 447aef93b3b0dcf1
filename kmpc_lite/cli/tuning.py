"""How to drive, on a command line: faster, closer, smoother; and what it changes in a scenario."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from kmpc_lite.cli.goals import goals_of
from kmpc_lite.cli.numbers import number
from kmpc_lite.errors import ScenarioError, did_you_mean
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.drawn import goals_table

WEIGHTS = "weights"
"""Section of a scenario with the weights of commands and their changes."""
TURN_SHARE = 4.0
"""Change of the turn rate [rad/s^2] for each m/s^2 of ``--max-acceleration``."""


class Wishes(NamedTuple):
    """What a command line asks of a drive, instead of what its scenario says."""

    goals: Sequence[tuple[float, float, float]] = ()
    """One after the other; without a scenario, on an empty map."""
    loop: bool = False
    """Whether the first goal follows the last one, until time is up."""
    clearance: float | None = None
    """To keep from obstacles beyond the radii [m]."""
    radius: float | None = None
    """Of the robot [m]."""
    options: Sequence[str] = ()
    """Options of the controller: ``group.option=value``; ``weights.R_change=[0.1, 0.1]``."""

    def put(self, table: dict[str, Any]) -> None:
        """Put them into the table of a scenario; raises ScenarioError for unknown options."""
        if self.goals:
            table["robot"].update(goals_table(self.goals))
        run = table.setdefault("run", {})
        if self.loop:
            run["loop"] = True
        if self.radius is not None:
            table["robot"]["radius"] = self.radius
        if self.clearance is not None:
            run["margin"] = self.clearance
        for item in self.options:
            name, value = assignment(item)
            *groups, option = name
            if groups == [WEIGHTS]:
                table.setdefault(WEIGHTS, {})[option] = value
                continue
            place = table.setdefault("controller", {})
            for group in groups:
                place = place.setdefault(group, {})
            place[option] = value
            check_options(item, table["controller"])


def add_clearance(add: Callable[..., object]) -> None:
    """Add how close the robot may come."""
    add(
        "--clearance",
        "--margin",
        dest="margin",
        type=number,
        metavar="M",
        help="distance to keep from obstacles beyond the radii [m]; the model's "
        "uncertainty adds to it",
    )


def wishes_of(options: argparse.Namespace, tuning: Sequence[str]) -> Wishes:
    """Give what a command line asks for; `tuning` are its ``--set`` of the controller."""
    given = goals_of(options), options.loop, options.margin, vars(options).get("radius")
    return Wishes(*given, tuning)


def assignment(item: str) -> tuple[list[str], Any]:
    """Parts of the name and TOML value of ``group.option=value``; raises ScenarioError."""
    name, equals, value = item.partition("=")
    parts = name.strip().split(".")
    try:
        if not (equals and len(parts) > 1):
            raise ValueError
        return parts, parse_toml(f"value = {value}")["value"]
    except ValueError:
        raise ScenarioError(
            f"--set {item}: expected group.option=value: margins.headway=0.2"
        ) from None


def check_options(item: str, tables: dict[str, Any]) -> None:
    """Raise ScenarioError, with the nearest names, for options that no controller has."""
    from kmpc_lite.control.options import ControllerOptions
    from kmpc_lite.errors import ProblemError

    try:
        ControllerOptions.from_dict(tables)
    except ProblemError as error:
        raise ScenarioError(f"--set {item}: {error}") from error


def split_settings(items: Sequence[str], sections: Sequence[str]) -> tuple[list[str], list[str]]:
    """Tell what is a robot file's (its sections) from what is the controller's (its groups).

    Raises
    ------
    ScenarioError
        For a name that is neither.
    """
    from dataclasses import fields

    from kmpc_lite.control.options import ControllerOptions

    groups = [WEIGHTS, *(field.name for field in fields(ControllerOptions))]
    own: list[str] = []
    tuning: list[str] = []
    for item in items:
        name = item.partition("=")[0].partition(".")[0].strip()
        if name not in (*sections, *groups):
            expected = f"; expected one of {', '.join((*sections, *groups))}"
            raise ScenarioError(
                f"--set {item}: no group or section named {name!r}"
                f"{did_you_mean(name, [*groups, *sections]) or expected}"
            )
        (tuning if name in groups else own).append(item)
    return own, tuning
