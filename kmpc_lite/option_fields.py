"""Fields of options that know their unit: what they accept, and how radii become lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, fields, replace
from functools import partial
from typing import Any, TypeVar

from kmpc_lite.errors import ProblemError

Options = TypeVar("Options")


def _number(
    unit: str, default: float, *, zero: bool = True, most: float = math.inf, whole: bool = True
) -> Any:
    """Finite number >= 0, or > 0, up to the most; without it if not the whole is allowed."""
    limits = {"unit": unit, "zero": zero, "most": most, "whole": whole}
    return field(default=default, metadata=limits)


radii = partial(_number, "radii")
"""Length in robot radii; may be zero unless excluded, as all that follow."""
seconds = partial(_number, "s")
"""Time of the robot that is its own unit [s]; another one takes `Scale.time` times as long."""
clock_seconds = partial(_number, "s by the clock")
"""Time by the clock [s], whatever the robot: what hangs on sensors and computers."""
angle = partial(_number, "rad")
share = partial(_number, "1")  # ratio of two values of the same unit
part = partial(_number, "1", most=1.0)  # share from 0 to 1
probability = partial(_number, "1", zero=False, most=1.0, whole=False)
"""Probability between 0 and 1, neither of them."""


def shares(*default: float) -> Any:
    """Ratios that are tried one after the other; a negative one means the other direction."""
    return field(default=default, metadata={"unit": "1 each"})


def count(default: int, least: int = 1, most: float = math.inf) -> Any:
    """Whole number from a least one up to the most."""
    return field(default=default, metadata={"unit": "count", "least": least, "most": most})


def switch(default: bool) -> Any:
    """True or false."""
    return field(default=default, metadata={"unit": "switch"})


def group(default: Any) -> Any:
    """Options of their own."""
    return field(default=default, metadata={"unit": "group", "kind": type(default)})


def check(options: Any) -> None:
    """Check every field of an options dataclass against its unit.

    Raises ProblemError: names the class, the field, and the value that is wrong.
    """
    for f in fields(options):
        value = getattr(options, f.name)
        if expected := _expected(value, f.metadata):
            where = f"{type(options).__name__}.{f.name}"
            raise ProblemError(f"{where}: expected {expected}, got {value!r:.80}")


def _expected(value: Any, limits: Mapping[str, Any]) -> str:
    """What a field takes instead of a value, in words; nothing if the value is right."""
    unit = limits["unit"]
    if unit == "count":
        least, most = limits["least"], limits["most"]
        right = not isinstance(value, bool) and isinstance(value, int) and least <= value <= most
        upwards = f">= {least}" if most == math.inf else f"from {least} to {most}"
        return "" if right else f"a whole number {upwards}"
    if unit == "switch":
        return "" if isinstance(value, bool) else "true or false"
    if unit == "group":
        return "" if isinstance(value, limits["kind"]) else limits["kind"].__name__
    if unit.endswith("each"):
        right = isinstance(value, tuple) and bool(value) and all(map(_is_number, value))
        return "" if right else "a tuple of finite numbers"
    zero, most, whole = limits["zero"], limits["most"], limits["whole"]
    if _is_number(value) and (value > 0 or zero and value == 0):
        if value < most or whole and value == most:
            return ""
    if most == math.inf:
        return f"a number {'>=' if zero else '>'} 0 [{unit}]"
    return "a share from 0 to 1" if whole else "a probability between 0 and 1"


def lengths_from_radii(options: Options, radius: float) -> Options:
    """Return the same options with lengths for a radius, in the unit of that radius.

    Examples
    --------
    >>> from kmpc_lite.control.options import GuidanceOptions
    >>> lengths_from_radii(GuidanceOptions(), 0.15).wide_clearance
    0.06
    """
    described: Any = options
    lengths = [f.name for f in fields(described) if f.metadata["unit"] == "radii"]
    made: Options = replace(
        described, **{name: radius * getattr(options, name) for name in lengths}
    )
    return made


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
