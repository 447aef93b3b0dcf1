"""Polygons, walls and grids in scenario files: checked in, written out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.shapes import Polygon, Wall
from kmpc_lite.errors import ProblemError, ScenarioError

FREE, OCCUPIED, UNKNOWN = ".", "#", "?"
"""Cells of a grid that is drawn in a scenario file, its highest row first."""
CELLS = {FREE: 0, OCCUPIED: 100, UNKNOWN: -1}
Made = TypeVar("Made")
LARGEST_NUMBER = 1e6
"""Farther [m], or later [s], no drive of a scenario gets."""
GRID_KEYS = ("resolution", "origin", "rows", "unknown_is_free")


def read_polygons(where: str, value: Any) -> tuple[Polygon, ...]:
    """Polygons from lists of corners."""
    if not isinstance(value, list):
        raise ScenarioError(
            f"{where}: expected a list of polygons [[x, y], [x, y], [x, y], ...], got {value!r}"
        )
    polygons = tuple(_make(f"{where}: polygon {i}", Polygon, row) for i, row in enumerate(value))
    for i, polygon in enumerate(polygons):
        if not np.abs(polygon.vertices).max() <= LARGEST_NUMBER:
            raise ScenarioError(f"{where}: polygon {i}: expected at most {LARGEST_NUMBER:g} m")
    return polygons


def read_walls(where: str, value: Any) -> tuple[Wall, ...]:
    """Walls from rows."""
    what = "[x1, y1, x2, y2] or [x1, y1, x2, y2, thickness]"
    if not isinstance(value, list):
        raise ScenarioError(f"{where}: expected a list of {what}, got {value!r}")
    walls = []
    for i, row in enumerate(value):
        if (
            not isinstance(row, list)
            or len(row) not in (4, 5)
            or any(not _is_number(v) for v in row)
        ):
            raise ScenarioError(f"{where}: wall {i}: expected {what}, got {row!r}")
        walls.append(_make(f"{where}: wall {i}", Wall, *row))
    return tuple(walls)


def read_grid(where: str, value: Any) -> OccupancyGrid | None:
    """Grid from the path of a map.yaml, or from rows that draw it; none from an empty path."""
    if value == "":
        return None
    if isinstance(value, str):
        return _make(where, OccupancyGrid.load, Path(value))
    if not isinstance(value, Mapping) or not {"resolution", "rows"} <= set(value) <= set(GRID_KEYS):
        raise ScenarioError(
            f"{where}: expected the path of a map.yaml, or a table of {', '.join(GRID_KEYS)}, "
            f"got {value!r:.60}"
        )
    rows = value["rows"]
    if (
        not isinstance(rows, list)
        or not rows
        or any(not isinstance(r, str) or len(r) != len(rows[0]) for r in rows)
    ):
        raise ScenarioError(f"{where}: rows: expected strings of one length")
    if strange := set("".join(rows)) - set(CELLS):
        raise ScenarioError(
            f"{where}: rows: expected {FREE} (free), {OCCUPIED} (occupied) and {UNKNOWN} "
            f"(unknown), got {min(strange)!r}"
        )
    cells = np.array([[CELLS[c] for c in row] for row in reversed(rows)], dtype=np.int8)
    free = value.get("unknown_is_free", False)
    if not isinstance(free, bool):
        raise ScenarioError(f"{where}: unknown_is_free: expected true or false, got {free!r}")
    return _make(
        where,
        OccupancyGrid,
        cells,
        value["resolution"],
        value.get("origin", [0.0, 0.0, 0.0]),
        unknown_is_free=free,
    )


def grid_to_toml(grid: OccupancyGrid) -> str:
    """Draw a grid as the value that `read_grid` reads back."""
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


def _make(where: str, kind: Callable[..., Made], *values: Any, **options: Any) -> Made:
    try:
        return kind(*values, **options)
    except ProblemError as error:
        raise ScenarioError(f"{where}: {error}") from error


def _is_number(value: Any) -> bool:
    return (
        not isinstance(value, bool)
        and isinstance(value, int | float)
        and abs(value) <= LARGEST_NUMBER
    )
