"""What a drive is asked for on a command line, instead of what its scenario says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from kmpc_lite.errors import ProblemError, ScenarioError
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.drawn import goals_table

WEIGHTS = "weights"  # section of a scenario


class DriveOverrides(NamedTuple):
    """What counts instead of a scenario's own."""

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
            (*groups, option), value = assignment(item)
            if groups == [WEIGHTS]:
                table.setdefault(WEIGHTS, {})[option] = value
                continue
            place = table.setdefault("controller", {})
            for group in groups:
                place = place.setdefault(group, {})
            place[option] = value
            check_options(item, table["controller"])


def assignment(item: str) -> tuple[list[str], Any]:
    """Parts of the name and TOML value of ``group.option=value``; raises ScenarioError."""
    name, equals, value = item.partition("=")
    parts = name.strip().split(".")
    expected = f"--set {item}: expected group.option=value: margins.headway=0.2"
    if not (equals and len(parts) > 1):
        raise ScenarioError(expected)
    try:
        return parts, parse_toml(f"value = {value}")["value"]
    except ValueError:
        raise ScenarioError(expected) from None


def check_options(item: str, tables: dict[str, Any]) -> None:
    """Raise ScenarioError, with the nearest names, for options that no controller has."""
    from kmpc_lite.control.options import ControllerOptions

    try:
        ControllerOptions.from_dict(tables)
    except ProblemError as error:
        raise ScenarioError(f"--set {item}: {error}") from error
