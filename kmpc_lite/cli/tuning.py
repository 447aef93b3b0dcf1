"""How to drive, on a command line: faster, closer, smoother."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from kmpc_lite.cli.goals import goals_of
from kmpc_lite.cli.numbers import number
from kmpc_lite.errors import ScenarioError, did_you_mean
from kmpc_lite.scenario.overrides import WEIGHTS, DriveOverrides

TURN_SHARE = 4.0
"""Of the turn rate [rad/s^2], for each m/s^2 of ``--max-acceleration``."""


def add_clearance(add: Callable[..., object]) -> None:
    """Add how close the robot may come."""
    text = (
        "distance to keep from obstacles beyond the radii [m]; the model's uncertainty adds to it"
    )
    add("--clearance", "--margin", dest="margin", type=number, metavar="M", help=text)


def drive_overrides(options: argparse.Namespace, tuning: Sequence[str]) -> DriveOverrides:
    """Give what a command line asks for; `tuning` are its ``--set`` of the controller."""
    radius = vars(options).get("radius")
    return DriveOverrides(goals_of(options), options.loop, options.margin, radius, tuning)


def split_settings(items: Sequence[str], sections: Sequence[str]) -> tuple[list[str], list[str]]:
    """Tell what is a robot file's (its sections) from what is the controller's (its groups).

    Raises ScenarioError for a name that is neither.
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
