"""All rows by their names, in the order of ``rows.toml``: a family a table, a drive a line.

A line names its maker, a function of `build`, `places` or `mishaps`, and gives it arguments. A
table with one key makes what that names: ``{Wall = [0, -3, 0, -0.3, 0.1]}``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import kmpc_lite as kl
from outcomes import models, sensing
from outcomes.plant import Body
from outcomes.rows import build, mishaps, places, poses
from outcomes.setup import Row, Setup
from outcomes.steered import Rollers, Steering

MAKES: dict[str, Callable[..., Any]] = {
    **{one.__name__: one for one in (Body, Steering, Rollers, kl.Wall, kl.Car, kl.Omni)},
    **{one.__name__: one for one in (sensing.Within, sensing.Scanner)},
    **{one.__name__: one for one in (places.Path, poses.Jump, poses.Lost, poses.Frozen)},
    "Both": lambda **scanner: sensing.Both(sensing.Scanner(**scanner)),
    "Polygon": lambda *corners: kl.Polygon(corners),
    "Footprint": lambda *corners: kl.Footprint(corners),
    "Rectangle": kl.Footprint.rectangle,
    "Learned": models.learned_body,
    "Nothing": lambda: None,
    "Options": lambda **changed: kl.ControllerOptions.from_dict(changed),
}
MAKERS = {
    name: one
    for module in (build, places, mishaps)
    for name, one in vars(module).items()
    if getattr(one, "__module__", "") == module.__name__
}


def made(value: Any) -> Any:
    """What a value of the file stands for."""
    if isinstance(value, list):
        return tuple(made(each) for each in value)
    if not isinstance(value, Mapping) or not value:
        return value
    (name, inner), *others = value.items()
    if others or name not in MAKES:
        return {key: made(each) for key, each in value.items()}
    given = made(inner)
    if isinstance(given, Mapping):
        return MAKES[name](**given)
    return MAKES[name](*given) if isinstance(given, tuple) else MAKES[name](given)


def make(line: Mapping[str, Any], seed: int) -> Setup | None:
    """Make a drive anew: sensors remember."""
    given = {name: made(value) for name, value in line.items()}
    maker = MAKERS[given.pop("make")]
    found: Setup | None = maker(seed, **given)
    return found


def _rows() -> dict[str, Row]:
    found = {}
    with Path(__file__).with_name("rows.toml").open("rb") as file:
        families = tomllib.load(file)
    for family, table in families.items():
        for name, line in table.items():
            about = {k: line.pop(k) for k in ("quick", "right", "touches", "chatter") if k in line}
            if name in found:
                raise ValueError(f"two rows with one name: {name!r}")
            found[name] = Row(name, family, partial(make, line), **about)
    return found


ROWS: dict[str, Row] = _rows()
