"""Keys of a scenario file: their defaults, and how their values are read and checked."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.options.sight import USUAL_OBSTACLES
from kmpc_lite.control.wheels import Wheels, read_wheels
from kmpc_lite.control.world.circles import Circle
from kmpc_lite.errors import ProblemError, ScenarioError, did_you_mean
from kmpc_lite.scenario.arrival import ARRIVED
from kmpc_lite.scenario.shapes import LARGEST_NUMBER, read_grid, read_polygons, read_walls

KEYS: Mapping[str, Mapping[str, Any]] = {
    "map": {"bounds": [], "circles": [], "polygons": [], "walls": [], "grid": ""},
    "robot": {
        "radius": 0.15,
        "footprint": [],
        "start": None,
        "goal": None,
        "via": [],
        "turning_point": [0.0, 0.0],
        "du_max": [],
        "wheels": [],
    },
    "weights": {"R": [], "R_change": []},
    "plant": {
        "slip": 0.0,
        "turn_gain": 1.0,
        "lag": 0.0,
        "dead_time": 0.0,
        "floors": [],
        "ground": "tile",
        "ground_changes": [],
        "ground_patches": [],
        "pose_noise": [0.0, 0.0, 0.0],
        "pose_age": 0.0,
    },
    "run": {
        "seed": 0,
        "timeout": 20.0,
        "tolerance": ARRIVED.distance,
        "heading_tolerance": ARRIVED.heading,
        "margin": 0.0,
        "loop": False,
    },
}
"""Sections, keys and defaults; None means that the key must be given."""
CONTROLLER = "controller"
"""Section of the controller's options: a table for each room, `ControllerOptions.from_dict`."""
FLOAT_LISTS = {"bounds": 4, "start": 3, "goal": 3, "turning_point": 2, "pose_noise": 3}
GROUND_ROWS = {"ground_changes": ("time", "name"), "ground_patches": ("name", "x", "y", "radius")}
POSITIVE = frozenset({"radius", "turn_gain", "timeout", "tolerance", "heading_tolerance"})
LARGEST = {
    "slip": 0.99,
    "turn_gain": 10.0,
    "lag": 10.0,
    "dead_time": 10.0,
    "pose_age": 10.0,
    "timeout": 100_000.0,
}
"""What a drive can be simulated with: beyond these are slips of the pen, and drives that no memory
holds."""


class Floor(NamedTuple):
    """What the ground does from a time on."""

    time: float
    """Since the plant began [s]."""
    slip: float
    """Mean of the three slip ratios."""
    turn_gain: float = 1.0
    """Share of a commanded turn that happens."""


def check_keys(where: str, table: Mapping[str, Any], free: Sequence[str]) -> None:
    """Raise ScenarioError for unknown sections and keys; those of `free` are read elsewhere."""
    sections = (*KEYS, *free)
    for section, content in table.items():
        if section in free:
            continue
        if section not in KEYS:
            raise ScenarioError(
                f"{where}: unknown section [{section}]{did_you_mean(section, sections)}; "
                f"expected {', '.join(f'[{s}]' for s in sections)}"
            )
        if not isinstance(content, Mapping):
            raise ScenarioError(f"{where}: [{section}] must be a section, got {content!r}")
        for key in content:
            if key not in KEYS[section]:
                hint = did_you_mean(key, KEYS[section])
                raise ScenarioError(
                    f"{where}: [{section}] {key}: unknown key{hint}; "
                    f"expected {', '.join(KEYS[section])}"
                )


def read_options(where: str, value: Any) -> ControllerOptions:
    """Read the controller's options, room by room; ScenarioError says what is wrong."""
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{where}: expected a section, got {value!r:.40}")
    try:
        return ControllerOptions.from_dict(value)
    except ProblemError as error:
        raise ScenarioError(f"{where} {error}") from error


def options_to_toml(changed: Mapping[str, Any], section: str = CONTROLLER) -> list[str]:
    """Lines of the sections that `read_options` reads back, from `ControllerOptions.changed`."""
    tables = {name: value for name, value in changed.items() if isinstance(value, Mapping)}
    lines: list[str] = []
    for name, value in changed.items():
        if name not in tables:
            # JSON writes numbers, lists and switches as TOML does
            lines.append(f"{name} = {json.dumps(value)}")
    if lines:
        lines = [f"[{section}]", *lines, ""]
    for name, table in tables.items():
        lines += options_to_toml(table, f"{section}.{name}")
    return lines


def read_value(where: str, key: str, value: Any) -> Any:
    """Read one value of a scenario.

    Parameters
    ----------
    where : str
        File, section and key, for errors.
    key : str
        One of `KEYS`.
    value : Any
        As TOML gives it.

    Raises
    ------
    ScenarioError
        Says what was expected, and what came.
    """
    if key in READERS:
        return READERS[key](where, value)
    if key in GROUND_ROWS:
        return _ground(where, GROUND_ROWS[key], value)
    if key in FLOAT_LISTS:
        return _numbers(where, key, value)
    number = read_number(where, value, LARGEST.get(key, LARGEST_NUMBER))
    if number < 0 or (key in POSITIVE and number == 0):
        sign = ">" if key in POSITIVE else ">="
        raise ScenarioError(f"{where}: expected a number {sign} 0, got {value!r}")
    return number


def read_number(where: str, value: Any, most: float = LARGEST_NUMBER) -> float:
    """Read a finite number, on either side of zero not beyond `most`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
        raise ScenarioError(f"{where}: expected a finite number, got {value!r:.40}")
    if abs(value) > most:
        raise ScenarioError(f"{where}: expected at most {most:g}, got {value!r:.40}")
    return float(value)


def _rows(where: str, lengths: tuple[int, ...], expected: str, value: Any) -> list[list[Any]]:
    """Read a list of rows of some length."""
    if not isinstance(value, list) or any(
        not isinstance(row, list) or len(row) not in lengths for row in value
    ):
        raise ScenarioError(f"{where}: expected a list of {expected}, got {value!r}")
    return value


def _circles(where: str, value: Any) -> tuple[Circle, ...]:
    expected = "[x, y, radius] or [x, y, radius, vx, vy]"
    if not isinstance(value, list):
        raise ScenarioError(f"{where}: expected a list of {expected}, got {value!r}")
    if len(value) > USUAL_OBSTACLES.circles:
        raise ScenarioError(
            f"{where}: expected at most {USUAL_OBSTACLES.circles:,} circles, got {len(value):,}"
        )
    circles = []
    for i, row in enumerate(value):
        place = f"{where}: circle {i}"
        if not isinstance(row, list) or len(row) not in (3, 5):
            raise ScenarioError(f"{place}: expected {expected}, got {row!r}")
        try:
            circles.append(Circle(*(read_number(place, v) for v in row)))
        except ProblemError as error:
            raise ScenarioError(f"{place}: {error}") from error
    return tuple(circles)


def _floors(where: str, value: Any) -> tuple[Floor, ...]:
    floors = []
    for i, row in enumerate(_rows(where, (3,), "[time, slip, turn_gain]", value)):
        names = zip(Floor._fields, row, strict=True)
        floors.append(Floor(*(read_value(f"{where}: floor {i}", name, v) for name, v in names)))
    return tuple(floors)


def _ground(where: str, kinds: tuple[str, ...], value: Any) -> tuple[tuple[Any, ...], ...]:
    rows = _rows(where, (len(kinds),), f"[{', '.join(kinds)}]", value)
    return tuple(
        tuple(read_value(where, kind, v) for kind, v in zip(kinds, row, strict=True))
        for row in rows
    )


def _name(where: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ScenarioError(f"{where}: expected the name of a floor, got {value!r}")
    return value


def _numbers(where: str, key: str, value: Any) -> tuple[float, ...]:
    if key == "bounds" and value == []:
        return ()
    if not isinstance(value, list) or len(value) != FLOAT_LISTS[key]:
        raise ScenarioError(f"{where}: expected {FLOAT_LISTS[key]} numbers, got {value!r}")
    numbers = tuple(read_number(where, v) for v in value)
    if key == "pose_noise" and min(numbers) < 0:
        raise ScenarioError(f"{where}: expected numbers >= 0, got {value!r}")
    return numbers


def _pair(where: str, value: Any) -> tuple[float, float] | None:
    if value == []:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise ScenarioError(f"{where}: expected 2 numbers, got {value!r}")
    numbers = read_number(where, value[0]), read_number(where, value[1])
    if min(numbers) <= 0:
        raise ScenarioError(f"{where}: expected numbers > 0, got {value!r}")
    return numbers


def _weights(where: str, value: Any) -> tuple[float, ...] | None:
    """Weights of a command's numbers; the problem knows how many there are."""
    if value == []:
        return None
    if not isinstance(value, list):
        raise ScenarioError(f"{where}: expected a list of weights, got {value!r:.40}")
    weights = tuple(read_number(where, v) for v in value)
    if min(weights) < 0:
        raise ScenarioError(f"{where}: expected numbers >= 0, got {value!r}")
    return weights


def _wheels(where: str, value: Any) -> tuple[float, float] | Wheels | None:
    if isinstance(value, list):
        return _pair(where, value)
    try:
        return read_wheels(value)
    except (ProblemError, TypeError, ValueError) as error:
        raise ScenarioError(f"{where}: {error}") from error


def _footprint(where: str, value: Any) -> Footprint | None:
    if value == []:
        return None
    try:
        made = Footprint.of(value)
    except ProblemError as error:
        raise ScenarioError(f"{where}: {error}") from error
    if not made.radius <= LARGEST_NUMBER:
        raise ScenarioError(f"{where}: expected at most {LARGEST_NUMBER:g} m")
    return made


def _poses(where: str, value: Any) -> tuple[tuple[float, ...], ...]:
    rows = _rows(where, (3,), "[x, y, theta]", value)
    return tuple(tuple(read_number(where, v) for v in row) for row in rows)


def _switch(where: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ScenarioError(f"{where}: expected true or false, got {value!r}")
    return value


def _seed(where: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ScenarioError(f"{where}: expected a whole number >= 0, got {value!r}")
    return value


READERS: Mapping[str, Callable[[str, Any], Any]] = {
    "R": _weights,
    "R_change": _weights,
    "circles": _circles,
    "du_max": _pair,
    "floors": _floors,
    "footprint": _footprint,
    "grid": read_grid,
    "ground": _name,
    "loop": _switch,
    "name": _name,
    "polygons": read_polygons,
    "seed": _seed,
    "via": _poses,
    "walls": read_walls,
    "wheels": _wheels,
    "x": read_number,
    "y": read_number,
}
"""What reads the values that are more than a number or some numbers."""
