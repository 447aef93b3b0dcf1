"""Keys of a scenario file: their defaults, how their values are read, and how they are written.

The simulated lidar is its section ``[lidar]``, without which all is known.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import USUAL_OBSTACLES, ControllerOptions
from kmpc_lite.control.wheels import Wheels, read_wheels
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall
from kmpc_lite.errors import ProblemError, ScenarioError, did_you_mean
from kmpc_lite.scenario.touch import ARRIVED

CONTROLLER, LIDAR = "controller", "lidar"
"""Sections of the controller's options, a table for each room, and of the simulated lidar."""
LARGEST_NUMBER = 1e6  # farther [m], or later [s], no drive of a scenario gets
FREE, OCCUPIED, UNKNOWN = ".", "#", "?"
"""Cells of a grid that is drawn in a scenario file, its highest row first."""
CELLS = {FREE: 0, OCCUPIED: 100, UNKNOWN: -1}
GRID_KEYS = ("resolution", "origin", "rows", "unknown_is_free")
Read = Callable[[str, Any], Any]
"""Reads one value: takes file, section and key, for errors, and what TOML gives; raises
ScenarioError that says what was expected, and what came."""
FARTHEST, FASTEST = 1000.0, 1000.0  # largest reach and mount [m], and highest rate [Hz]


class Floor(NamedTuple):
    """What the ground does from a time on."""

    time: float  # since the plant began [s]
    slip: float  # mean of the three slip ratios
    turn_gain: float = 1.0  # share of a commanded turn that happens


def read_number(where: str, value: Any, most: float = LARGEST_NUMBER) -> float:
    """Read a finite number, on either side of zero not beyond `most`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
        raise ScenarioError(f"{where}: expected a finite number, got {value!r:.40}")
    if abs(value) > most:
        raise ScenarioError(f"{where}: expected at most {most:g}, got {value!r:.40}")
    return float(value)


def at_least_zero(most: float = LARGEST_NUMBER, zero: bool = True) -> Read:
    """Read a number that is not below zero, nor zero unless that may be."""

    def read(where: str, value: Any) -> float:
        number = read_number(where, value, most)
        if number < 0.0 or (number == 0.0 and not zero):
            sign = ">=" if zero else ">"
            raise ScenarioError(f"{where}: expected a number {sign} 0, got {value!r}")
        return number

    return read


def numbers(
    count: int | None = None, sign: str = "", empty: Any = ..., most: float = LARGEST_NUMBER
) -> Read:
    """Read a list of so many numbers, all of them ">= 0" or "> 0"; what an empty one means."""

    def read(where: str, value: Any) -> Any:
        if value == [] and empty is not ...:
            return empty
        if not isinstance(value, list) or count not in (None, len(value)):
            what = "a list of numbers" if count is None else f"{count} numbers"
            raise ScenarioError(f"{where}: expected {what}, got {value!r:.40}")
        found = tuple(read_number(where, v, most) for v in value)
        if sign and (min(found) < 0.0 or (sign == "> 0" and min(found) == 0.0)):
            raise ScenarioError(f"{where}: expected numbers {sign}, got {value!r}")
        return found

    return read


def _rows(columns: Mapping[str, Read], make: Callable[..., Any] | None, what: str = "") -> Read:
    """Read a list of rows, each value by its column, the last ones of which may be left out."""

    def read(where: str, value: Any) -> tuple[Any, ...]:
        expected = f"a list of [{', '.join(columns)}]"
        whole = isinstance(value, list) and all(isinstance(r, list) for r in value)
        if not whole or any(len(row) != len(columns) for row in value):
            raise ScenarioError(f"{where}: expected {expected}, got {value!r}")
        found = []
        for i, row in enumerate(value):
            place = f"{where}: {what} {i}" if what else where
            found.append([columns[c](place, v) for c, v in zip(columns, row, strict=True)])
        return tuple(tuple(row) if make is None else make(*row) for row in found)

    return read


def _made(where: str, make: Callable[..., Any], *values: Any, **options: Any) -> Any:
    """What a class makes of values; its ProblemError as ScenarioError."""
    try:
        return make(*values, **options)
    except (ProblemError, TypeError, ValueError) as error:
        raise ScenarioError(f"{where}: {error}") from error


def _shapes(what: str, row: str, lengths: tuple[int, ...], make: Callable[..., Any]) -> Read:
    """Read a list of circles, or of walls, from rows of numbers; the last ones may be left out."""

    def read(where: str, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise ScenarioError(f"{where}: expected a list of {row}, got {value!r}")
        if len(value) > USUAL_OBSTACLES.circles:
            most = f"{USUAL_OBSTACLES.circles:,} {what}s"
            raise ScenarioError(f"{where}: expected at most {most}, got {len(value):,}")
        found = []
        for i, values in enumerate(value):
            place = f"{where}: {what} {i}"
            if not isinstance(values, list) or len(values) not in lengths:
                raise ScenarioError(f"{place}: expected {row}, got {values!r}")
            found.append(_made(place, make, *(read_number(place, v) for v in values)))
        return tuple(found)

    return read


def _polygons(where: str, value: Any) -> tuple[Polygon, ...]:
    if not isinstance(value, list):
        raise ScenarioError(
            f"{where}: expected a list of polygons [[x, y], [x, y], [x, y], ...], got {value!r}"
        )
    found = tuple(_made(f"{where}: polygon {i}", Polygon, row) for i, row in enumerate(value))
    for i, polygon in enumerate(found):
        if not np.abs(polygon.vertices).max() <= LARGEST_NUMBER:
            raise ScenarioError(f"{where}: polygon {i}: expected at most {LARGEST_NUMBER:g} m")
    return found


def _grid(where: str, value: Any) -> OccupancyGrid | None:
    """Grid from the path of a map.yaml, or from rows that draw it; none from an empty path."""
    if value == "":
        return None
    if isinstance(value, str):
        made: OccupancyGrid = _made(where, OccupancyGrid.load, Path(value))
        return made
    if not isinstance(value, Mapping) or not {"resolution", "rows"} <= set(value) <= set(GRID_KEYS):
        raise ScenarioError(
            f"{where}: expected the path of a map.yaml, or a table of {', '.join(GRID_KEYS)}, "
            f"got {value!r:.60}"
        )
    rows, free = value["rows"], value.get("unknown_is_free", False)
    texts = isinstance(rows, list) and rows and all(isinstance(r, str) for r in rows)
    if not texts or len(set(map(len, rows))) > 1:
        raise ScenarioError(f"{where}: rows: expected strings of one length")
    if strange := set("".join(rows)) - set(CELLS):
        raise ScenarioError(
            f"{where}: rows: expected {FREE} (free), {OCCUPIED} (occupied) and {UNKNOWN} "
            f"(unknown), got {min(strange)!r}"
        )
    _switch(f"{where}: unknown_is_free", free)
    cells = np.array([[CELLS[c] for c in row] for row in reversed(rows)], dtype=np.int8)
    origin = value.get("origin", [0.0, 0.0, 0.0])
    made = _made(where, OccupancyGrid, cells, value["resolution"], origin, unknown_is_free=free)
    return made


def _name(where: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ScenarioError(f"{where}: expected the name of a floor, got {value!r}")
    return value


def _wheels(where: str, value: Any) -> tuple[float, float] | Wheels | None:
    if isinstance(value, list):
        pair: tuple[float, float] | None = numbers(2, "> 0", None)(where, value)
        return pair
    wheels: Wheels = _made(where, read_wheels, value)
    return wheels


def _footprint(where: str, value: Any) -> Footprint | None:
    if value == []:
        return None
    made: Footprint = _made(where, Footprint.of, value)
    if not made.radius <= LARGEST_NUMBER:
        raise ScenarioError(f"{where}: expected at most {LARGEST_NUMBER:g} m")
    return made


def _switch(where: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ScenarioError(f"{where}: expected true or false, got {value!r}")
    return value


def whole_number(least: int, most: float = math.inf) -> Read:
    """Read a whole number."""

    def read(where: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            span = f">= {least}" if most == math.inf else f"{least} .. {most}"
            raise ScenarioError(f"{where}: expected a whole number {span}, got {value!r:.40}")
        return value

    return read


_LEAST, _POSITIVE, _SECONDS = at_least_zero(), at_least_zero(zero=False), at_least_zero(10.0)
_SLIP, _TURN_GAIN = at_least_zero(0.99), at_least_zero(10.0, zero=False)
_PLACE = {"x": read_number, "y": read_number}
KEYS: Mapping[str, Mapping[str, tuple[Any, Read]]] = {
    "map": {
        "bounds": ([], numbers(4, empty=())),
        "circles": (
            [],
            _shapes("circle", "[x, y, radius] or [x, y, radius, vx, vy]", (3, 5), Circle),
        ),
        "polygons": ([], _polygons),
        "walls": (
            [],
            _shapes("wall", "[x1, y1, x2, y2] or [x1, y1, x2, y2, thickness]", (4, 5), Wall),
        ),
        "grid": ("", _grid),
    },
    "robot": {
        "radius": (0.15, _POSITIVE),
        "footprint": ([], _footprint),
        "start": (None, numbers(3)),
        "goal": (None, numbers(3)),
        "via": ([], _rows({**_PLACE, "theta": read_number}, None)),
        "turning_point": ([0.0, 0.0], numbers(2)),
        "du_max": ([], numbers(2, "> 0", None)),
        "wheels": ([], _wheels),
    },
    "weights": dict.fromkeys(("R", "R_change"), ([], numbers(None, ">= 0", None))),
    "plant": {
        "slip": (0.0, _SLIP),
        "turn_gain": (1.0, _TURN_GAIN),
        "lag": (0.0, _SECONDS),
        "dead_time": (0.0, _SECONDS),
        "floors": (
            [],
            _rows({"time": _LEAST, "slip": _SLIP, "turn_gain": _TURN_GAIN}, Floor, "floor"),
        ),
        "ground": ("tile", _name),
        "ground_changes": ([], _rows({"time": _LEAST, "name": _name}, None)),
        "ground_patches": ([], _rows({"name": _name, **_PLACE, "radius": _POSITIVE}, None)),
        "pose_noise": ([0.0, 0.0, 0.0], numbers(3, ">= 0")),
        "pose_age": (0.0, _SECONDS),
    },
    "run": {
        "seed": (0, whole_number(0)),
        "timeout": (20.0, at_least_zero(100_000.0, zero=False)),
        "tolerance": (ARRIVED.distance, _POSITIVE),
        "heading_tolerance": (ARRIVED.heading, _POSITIVE),
        "margin": (0.0, _LEAST),
        "loop": (False, _switch),
    },
}
"""Sections, keys, defaults and readers; None means that the key must be given. Beyond the largest
slips, gains and times are slips of the pen, and drives that no memory holds."""


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
        check_section(f"{where}: [{section}]", content, KEYS[section])


def check_section(where: str, content: Any, names: Mapping[str, Any]) -> None:
    """Raise ScenarioError for what is no section, and for unknown keys."""
    if not isinstance(content, Mapping):
        raise ScenarioError(f"{where} must be a section, got {content!r:.40}")
    for key in content:
        if key not in names:
            hint = did_you_mean(key, names)
            raise ScenarioError(f"{where} {key}: unknown key{hint}; expected {', '.join(names)}")


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
    lines = [f"{name} = {to_toml(v)}" for name, v in changed.items() if name not in tables]
    if lines:
        lines = [f"[{section}]", *lines, ""]
    for name, table in tables.items():
        lines += options_to_toml(table, f"{section}.{name}")
    return lines


def grid_to_toml(grid: OccupancyGrid) -> str:
    """Draw a grid as the value that a file holds."""
    drawn = np.where(grid.occupied, OCCUPIED, FREE)
    unknown_is_free = bool((grid.unknown & ~grid.occupied).any())
    drawn[grid.unknown] = UNKNOWN
    rows = ",\n  ".join(f'"{"".join(row)}"' for row in drawn[::-1])
    free = str(unknown_is_free).lower()
    return (
        f"{{resolution = {grid.resolution!r}, origin = {list(grid.origin)}, "
        f"unknown_is_free = {free}, rows = [\n  {rows},\n]}}"
    )


def to_toml(value: Any) -> str:
    """Render a number, a text, or lists and tables of them as a TOML value.

    >>> to_toml([1, 2.5, "carpet", True])
    '[1, 2.5, "carpet", true]'
    """
    if isinstance(value, str):
        # as JSON, but for the one character that JSON leaves as it is
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, int | np.integer):
        return repr(int(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {to_toml(v)}' for key, v in value.items())}}}"
    return f"[{', '.join(map(to_toml, value))}]"


@dataclass(frozen=True)
class LidarSpec:
    """A scanner as its data sheet has it."""

    reach: float = 4.0  # how far it sees [m]
    beams: int = 360  # number of beams, spread evenly all around
    noise: float = 0.01  # standard deviation of a range [m]
    dropout: float = 0.01  # share of beams that come back without a range
    nearest: float = 0.05  # least range [m]
    rate: float = 0.0  # turns a second [Hz]; 0: one for each step of the controller
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it sits on the robot: ahead, left [m], and its heading [rad]."""


READERS: dict[str, Read] = {
    "reach": at_least_zero(FARTHEST, zero=False),
    "beams": whole_number(1, USUAL_OBSTACLES.scan_beams),
    "noise": at_least_zero(1.0),
    "dropout": at_least_zero(1.0),
    "nearest": at_least_zero(FARTHEST),
    "rate": at_least_zero(FASTEST),
    "mount": numbers(3, most=FARTHEST),
}


def read_lidar(where: str, value: Any) -> LidarSpec | None:
    """Read the section; None if there is none.

    Raises ScenarioError: names the key, what was expected and what came.
    """
    if value is None:
        return None
    check_section(where, value, READERS)
    spec = LidarSpec(**{key: READERS[key](f"{where} {key}", found) for key, found in value.items()})
    if not spec.nearest < spec.reach:
        raise ScenarioError(f"{where} nearest: expected less than the reach, got {spec.nearest:g}")
    return spec


def lidar_to_toml(spec: LidarSpec | None) -> list[str]:
    """Lines of the section that `read_lidar` reads back; none without a lidar."""
    if spec is None:
        return []
    return [f"[{LIDAR}]", *(f"{key} = {to_toml(value)}" for key, value in asdict(spec).items()), ""]
