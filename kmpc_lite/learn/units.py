"""Units and frames that logs come in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.types import Array

FRAMES = ("enu", "ned", "swapped")
"""enu: x east, y north, theta counter-clockwise from x. ned: x north, y east, theta clockwise from
north. swapped: x and y exchanged, theta as it should be."""
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "in": 0.0254}
ANGLE = {"rad": 1.0, "deg": pi / 180.0, "cdeg": pi / 18000.0, "mrad": 1e-3, "rev": 2.0 * pi}
SPEED = {
    **{f"{name}/s": size for name, size in LENGTH.items()},
    "km/h": 1.0 / 3.6,
    "mph": 0.44704,
    "kn": 1852.0 / 3600.0,
}
TURN_RATE = {**{f"{name}/s": size for name, size in ANGLE.items()}, "rpm": pi / 30.0}
KNOWN = {"t": TIME, "x": LENGTH, "y": LENGTH, "theta": ANGLE, "v": SPEED, "omega": TURN_RATE}
"""Size of each unit, by column."""
FORM = re.compile(r"(?P<sign>-?)(?P<unit>[a-zA-Z/]+|[0-9.]+(?:e-?[0-9]+)?)(?P<offset>[+-][0-9.]+)?")


@dataclass(frozen=True)
class Unit:
    """How a column becomes SI: ``scale * value + offset``."""

    scale: float
    offset: float = 0.0

    def apply(self, values: Array) -> Array:
        """Convert values (n,)."""
        return self.scale * values + self.offset


def parse_units(units: Mapping[str, str]) -> dict[str, Unit]:
    """Read units by column: ``ns``, ``-rad`` for the other direction, ``-deg+90`` with an offset.

    A number instead of a name is the unit's size: ``0.0025`` [m/s] for steps of a motor's board.

    Raises
    ------
    DataError
        For a column or a unit that nobody knows.

    Examples
    --------
    >>> parse_units({"t": "ms", "theta": "-deg+90"})["t"]
    Unit(scale=0.001, offset=0.0)
    """
    return {column: _parse_unit(column, text) for column, text in units.items()}


def _parse_unit(column: str, text: str) -> Unit:
    """One unit."""
    known = KNOWN.get(column)
    if known is None:
        raise DataError(f"units: expected one of {', '.join(KNOWN)}, got {column!r}")
    found = FORM.fullmatch(text)
    name = found["unit"] if found else text
    size = known.get(name, _number(name))
    if found is None or not size:
        hint = did_you_mean(name, known) or f"; choose from {', '.join(known)}"
        such = _examples(column)
        raise DataError(f"units: {column}={text}: expected a unit such as {such}{hint}")
    offset = (_number(found["offset"]) or 0.0) if found["offset"] else 0.0
    return Unit(-size if found["sign"] else size, offset * size)


def _examples(column: str) -> str:
    """Units of a column that are often meant."""
    return "deg, -rad or -deg+90" if column == "theta" else f"{list(KNOWN[column])[1]} or -0.5"


def _number(text: str) -> float | None:
    """A number, or None."""
    try:
        return float(text)
    except ValueError:
        return None
