"""Fields of options that know their unit: what they accept, and how lengths become metres."""

from __future__ import annotations

import math
from dataclasses import field, fields, replace
from typing import Any, TypeVar

from kmpc_lite.errors import ProblemError

Options = TypeVar("Options")


def radii(default: float) -> Any:
    """Length in robot radii, >= 0."""
    return field(default=default, metadata={"unit": "radii"})


def metres(default: float) -> Any:
    """Length that does not follow from the robot's [m], >= 0."""
    return field(default=default, metadata={"unit": "m"})


def seconds(default: float) -> Any:
    """Time [s], >= 0."""
    return field(default=default, metadata={"unit": "s"})


def angle(default: float) -> Any:
    """Angle [rad], >= 0."""
    return field(default=default, metadata={"unit": "rad"})


def share(default: float) -> Any:
    """Ratio of two values of the same unit, >= 0."""
    return field(default=default, metadata={"unit": "1"})


def shares(*default: float) -> Any:
    """Ratios that are tried one after the other; a negative one means the other direction."""
    return field(default=default, metadata={"unit": "1 each"})


def moments(*default: float) -> Any:
    """Times that are tried one after the other [s]."""
    return field(default=default, metadata={"unit": "s each"})


def count(default: int, least: int = 1) -> Any:
    """Whole number, not less than a least one."""
    return field(default=default, metadata={"unit": "count", "least": least})


def check(options: Any) -> None:
    """Check every field of an options dataclass against its unit.

    Raises
    ------
    ProblemError
        Names the class, the field, and the value that is wrong.
    """
    for f in fields(options):
        value, unit = getattr(options, f.name), f.metadata["unit"]
        where = f"{type(options).__name__}.{f.name}"
        if unit == "count":
            least = f.metadata["least"]
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ProblemError(f"{where}: expected a whole number >= {least}, got {value!r}")
        elif unit.endswith("each"):
            if not (isinstance(value, tuple) and value and all(map(_is_number, value))):
                raise ProblemError(f"{where}: expected a tuple of finite numbers, got {value!r}")
        elif not (_is_number(value) and value >= 0):
            raise ProblemError(f"{where}: expected a number >= 0 [{unit}], got {value!r}")


def in_metres(options: Options, unit: float) -> Options:
    """Return the same options with lengths in metres, for a unit length [m].

    Examples
    --------
    >>> from kmpc_lite.control.options import GuidanceOptions
    >>> in_metres(GuidanceOptions(), 0.15).wide_clearance
    0.06
    """
    described: Any = options
    lengths = [f.name for f in fields(described) if f.metadata["unit"] == "radii"]
    metres: Options = replace(
        described, **{name: unit * getattr(options, name) for name in lengths}
    )
    return metres


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
