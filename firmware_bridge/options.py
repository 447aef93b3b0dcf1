"""Options as frozen dataclasses that check themselves, read from tables of a robot file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, field, fields
from numbers import Real
from typing import Any, TypeVar, get_type_hints

from firmware_bridge.messages import ConfigError

T = TypeVar("T")


def bounded(low: float, high: float, unit: str = "", default: Any = MISSING) -> Any:
    """Describe a number of a dataclass: its range, its unit, and its default if it has one."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit})


def check(options: Any) -> None:
    """Check a dataclass's ranges; ConfigError names the field, the expected and the given value.

    None is fine where it is the default.
    """
    for entry in fields(options):
        value = getattr(options, entry.name)
        if "low" not in entry.metadata or (value is None and entry.default is None):
            continue
        low, high, unit = entry.metadata["low"], entry.metadata["high"], entry.metadata["unit"]
        if not (is_number(value) and low <= value <= high):
            raise ConfigError(
                f"{entry.name}: expected {low:g} to {high:g}{unit and ' ' + unit}, got {value!r}"
            )


def is_number(value: object) -> bool:
    """Whether a value is a finite number."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def three_numbers(values: object) -> tuple[float, float, float] | None:
    """Three finite numbers of a list; None if it holds anything else.

    Examples
    --------
    >>> three_numbers([1, 2.5, 0]), three_numbers([1, 2]), three_numbers("abc")
    ((1.0, 2.5, 0.0), None, None)
    """
    if not isinstance(values, list | tuple) or len(values) != 3 or not all(map(is_number, values)):
        return None
    first, second, third = values
    return float(first), float(second), float(third)


def from_table(kind: type[T], table: Mapping[str, Any], section: str) -> T:
    """Build a dataclass from the section of a robot file.

    `kind`: a frozen dataclass whose fields are bool, int, float or str, or those or None; or Any,
    which is checked where it is used. `table`: the section. `section`: its name, for the messages.
    Raises ConfigError for a key that is missing, unknown, of another type, or out of range.
    """
    if not isinstance(table, Mapping):
        raise ConfigError(f"[{section}]: expected a table, got {table!r}")
    known = {entry.name: entry for entry in fields(kind)}  # type: ignore[arg-type]
    hints = get_type_hints(kind)
    for key in table:
        if key not in known:
            raise ConfigError(f"{section}.{key}: unknown key; [{section}] takes {', '.join(known)}")
    values: dict[str, Any] = {}
    for name, entry in known.items():
        if name in table:
            values[name] = _typed(
                table[name],
                str(hints[name]) if "|" in str(hints[name]) else hints[name].__name__,
                f"{section}.{name}",
            )
        elif entry.default is MISSING and entry.default_factory is MISSING:
            raise ConfigError(f"{section}.{name}: missing")
    try:
        return kind(**values)
    except ConfigError as error:
        raise ConfigError(f"{section}.{error}") from None


def _typed(value: Any, expected: str, name: str) -> Any:
    kinds: dict[str, tuple[type, ...]] = {
        "bool": (bool,),
        "int": (int,),
        "float": (int, float),
        "str": (str,),
    }
    kind = expected.split(" ")[0]
    if kind == "Any":
        return value
    if not isinstance(value, kinds[kind]) or (isinstance(value, bool) and kind != "bool"):
        raise ConfigError(f"{name}: expected {kind}, got {value!r}")
    typed: Any = value
    return float(typed) if kind == "float" else typed
