"""Scenario files: a map, a robot, a plant and how long to try.

A scenario is TOML; the ones that come with the package are named by their stem (``mehrez``,
``four_circles_1``, ...).
"""

from __future__ import annotations

import os
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kmpc_lite.control.obstacles.circles import Circle
from kmpc_lite.control.obstacles.occupancy import OccupancyGrid
from kmpc_lite.control.obstacles.scene import Solid
from kmpc_lite.control.obstacles.shapes import Polygon, Wall
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError, ScenarioError, did_you_mean
from kmpc_lite.sim.scenario.bundled import bundled, bundled_file
from kmpc_lite.sim.scenario.shapes import grid_to_toml, read_grid, read_polygons, read_walls
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Solids

FLOAT_LISTS = {"bounds": 4, "start": 3, "goal": 3, "turning_point": 2, "du_max": 2, "pose_noise": 3}
KEYS: Mapping[str, Mapping[str, Any]] = {
    "map": {"bounds": None, "circles": [], "polygons": [], "walls": [], "grid": ""},
    "robot": {
        "radius": 0.15,
        "start": None,
        "goal": None,
        "turning_point": [0.0, 0.0],
        "du_max": [],
    },
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
        "tolerance": 0.05,
        "heading_tolerance": 0.15,
        "margin": 0.0,
    },
}
"""Sections, keys and defaults; None means that the key must be given."""
GROUND_ROWS = {"ground_changes": ("time", "name"), "ground_patches": ("name", "x", "y", "radius")}
SHAPES = {"polygons": read_polygons, "walls": read_walls, "grid": read_grid}
POSITIVE = frozenset({"radius", "turn_gain", "timeout", "tolerance", "heading_tolerance"})
LARGEST = {
    "slip": 10.0,
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


@dataclass(frozen=True, eq=False)
class Scenario:
    """One drive: where, past what, on which floor.

    Lengths in m, angles in rad, times in s; frame ENU, heading counter-clockwise from east.
    """

    name: str
    bounds: tuple[float, float, float, float]
    """xmin, ymin, xmax, ymax of the robot's centre."""
    circles: tuple[Circle, ...]
    radius: float
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    slip: float = 0.0
    """Mean slip ratio of the plant."""
    turn_gain: float = 1.0
    """Share of a commanded turn that the plant makes."""
    lag: float = 0.0
    """Time constant of the plant's motors [s]."""
    dead_time: float = 0.0
    """Between a command and the motors' first reaction [s]."""
    floors: tuple[Floor, ...] = ()
    """Changes of slip and turn gain while driving, in order of time; in a file rows time, slip,
    turn gain."""
    ground: str = "tile"
    """Floor under the digital twin, by its name: `kmpc_lite.sim.twin.FLOORS`."""
    ground_changes: tuple[tuple[float, str], ...] = ()
    """Times [s] from which on the twin's whole floor is another one; in a file rows time, name."""
    ground_patches: tuple[tuple[str, float, float, float], ...] = ()
    """Round pieces of another floor under the twin: name, x, y, radius [m]."""
    pose_noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard deviation of the measured pose [m, m, rad]."""
    pose_age: float = 0.0
    """How old a measured pose is when it arrives [s]."""
    seed: int = 0
    timeout: float = 20.0
    tolerance: float = 0.05
    """Distance to the goal [m] that counts as arrived."""
    heading_tolerance: float = 0.15
    """Heading error [rad] that counts as arrived."""
    margin: float = 0.0
    """Distance [m] that the controller is asked to keep beyond the radii."""
    du_max: tuple[float, float] | None = None
    """How fast commands may change [m/s^2, rad/s^2]; as the problem has it where not given. In a
    file [] is the same."""
    turning_point: tuple[float, float] = (0.0, 0.0)
    """Where the point lies about which the plant turns on the spot, as seen from its pose: ahead,
    left [m]."""
    polygons: tuple[Polygon, ...] = ()
    walls: tuple[Wall, ...] = ()
    grid: OccupancyGrid | None = None
    """In a file the path of a map.yaml, from the file's own folder, or a table with rows that draw
    it."""

    def __post_init__(self) -> None:
        x_min, y_min, x_max, y_max = self.bounds
        if x_min >= x_max or y_min >= y_max:
            raise ScenarioError(
                f"{self.name}: [map] bounds: expected xmin < xmax and ymin < ymax, "
                f"got {list(self.bounds)}"
            )
        for key in ("start", "goal"):
            x, y, _ = getattr(self, key)
            if not (x_min <= x <= x_max and y_min <= y <= y_max):
                raise ScenarioError(
                    f"{self.name}: [robot] {key}: ({x:g}, {y:g}) lies outside the bounds "
                    f"{list(self.bounds)}"
                )
            for i, circle in enumerate(self.circles):
                distance = float(np.hypot(x - circle.x, y - circle.y))
                moving = circle.vx != 0.0 or circle.vy != 0.0
                if distance < circle.radius + self.radius and not (moving and key == "goal"):
                    raise ScenarioError(
                        f"{self.name}: [robot] {key}: ({x:g}, {y:g}) is {distance:g} m from the "
                        f"centre of circle {i}, "
                        f"but the radii add up to {circle.radius + self.radius:g} m"
                    )
            if self.solids is not None:
                gap = float(self.solids.whole.least(np.array([[x, y]]))[0])
                if gap < self.radius:
                    raise ScenarioError(
                        f"{self.name}: [robot] {key}: ({x:g}, {y:g}) is {gap:g} m from a polygon, "
                        "wall or grid cell, "
                        f"but the robot's radius is {self.radius:g} m"
                    )
        if any(b.time <= a.time for a, b in zip(self.floors, self.floors[1:], strict=False)):
            raise ScenarioError(
                f"{self.name}: [plant] floors: expected rising times, "
                f"got {[f.time for f in self.floors]}"
            )

    @classmethod
    def load(cls, source: str | os.PathLike[str]) -> Scenario:
        """Read a scenario file, or one of the package's own by its name.

        Raises
        ------
        ScenarioError
            Names the file, the section and the key.
        """
        path = Path(source)
        if not path.suffix and not path.exists():
            if path.name not in bundled():
                names = ", ".join(bundled())
                expected = f"; expected a .toml file or one of {names}"
                hint = did_you_mean(path.name, bundled()) or expected
                raise ScenarioError(f"no scenario named {str(source)!r}{hint}")
            path = bundled_file(path.name)
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ScenarioError(
                f"{path}: cannot read the scenario: {error.strerror or error}"
            ) from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ScenarioError(f"{path}: not TOML: {error}") from error
        area = table.get("map")
        if isinstance(area, dict) and isinstance(grid := area.get("grid"), str) and grid:
            area["grid"] = str(path.parent / grid)
        return cls.from_table(table, path.stem, str(path))

    @classmethod
    def from_table(cls, table: Mapping[str, Any], name: str, where: str) -> Scenario:
        """Check a parsed scenario, section by section."""
        for section, content in table.items():
            if section not in KEYS:
                raise ScenarioError(
                    f"{where}: unknown section [{section}]{did_you_mean(section, KEYS)}; "
                    f"expected {', '.join(f'[{s}]' for s in KEYS)}"
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
        values: dict[str, Any] = {}
        for section, defaults in KEYS.items():
            given = table.get(section, {})
            for key, default in defaults.items():
                if key not in given and default is None:
                    raise ScenarioError(f"{where}: [{section}] {key}: missing")
                values[key] = _value(f"{where}: [{section}] {key}", key, given.get(key, default))
        return cls(name=name, **values)

    def to_toml(self) -> str:
        """Render as a scenario file that `load` reads back."""
        rows = [list(c) if c.vx or c.vy else list(c[:3]) for c in self.circles]
        values = {
            **self.__dict__,
            "bounds": list(self.bounds),
            "circles": rows,
            "start": list(self.start),
            "goal": list(self.goal),
        }
        values["pose_noise"], values["floors"] = (
            list(self.pose_noise),
            [list(f) for f in self.floors],
        )
        values["turning_point"] = list(self.turning_point)
        values["ground_changes"], values["ground_patches"] = (
            [list(c) for c in self.ground_changes],
            [list(p) for p in self.ground_patches],
        )
        values["du_max"] = list(self.du_max or ())
        left_out = {"grid"} if self.du_max else {"grid", "du_max"}
        values["polygons"] = [[list(corner) for corner in p.vertices] for p in self.polygons]
        values["walls"] = [[w.x1, w.y1, w.x2, w.y2, w.thickness] for w in self.walls]
        lines: list[str] = []
        for section, keys in KEYS.items():
            lines += [
                f"[{section}]",
                *(f"{key} = {values[key]!r}" for key in keys if key not in left_out),
            ]
            lines += (
                [f"grid = {grid_to_toml(self.grid)}", ""]
                if section == "map" and self.grid is not None
                else [""]
            )
        return "\n".join(lines)

    def problem(self, base: NavigationProblem | None = None) -> NavigationProblem:
        """Navigation problem of this map and robot, the rest as in `base` or the paper."""
        x_min, y_min, x_max, y_max = self.bounds
        base = base or NavigationProblem()
        try:
            return replace(
                base,
                x_min=(x_min, y_min, -np.inf),
                x_max=(x_max, y_max, np.inf),
                robot_radius=self.radius,
                margin=self.margin,
                du_max=base.du_max if self.du_max is None else self.du_max,
            )
        except ProblemError as error:
            raise ScenarioError(f"{self.name}: {error}") from error

    @property
    def solids(self) -> Solids | None:
        """Polygons, walls and the grid, prepared for distances."""
        return _prepared(self.polygons, self.walls, self.grid)

    @property
    def obstacle_count(self) -> int:
        """Circles, polygons, walls, and the grid as one."""
        return len(self.circles) + (0 if self.solids is None else len(self.solids.solids))

    def obstacles_at(self, time: float) -> Any:
        """Obstacles as `Controller.step` takes them at a time [s].

        Circles alone are an array; with solids they are a list.
        """
        circles = self.circles_at(time)
        return circles if self.solids is None else [*circles, *self.solids.solids]

    def circles_at(self, time: float) -> Array:
        """Rows x, y, radius, vx, vy of the obstacles at a time [s], (M, 5)."""
        rows = np.array(self.circles, dtype=float).reshape(-1, 5)
        rows[:, :2] += time * rows[:, 3:]
        return rows


@lru_cache(maxsize=8)
def _prepared(
    polygons: tuple[Polygon, ...], walls: tuple[Wall, ...], grid: OccupancyGrid | None
) -> Solids | None:
    found: list[Solid] = [*polygons, *walls]
    if grid is not None:
        found.append(grid)
    if not found:
        return None
    from kmpc_lite.control.obstacles.solids import Solids

    return Solids(found)


def _number(where: str, value: Any) -> float:
    # a whole number too large for a float is none
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not abs(value) <= sys.float_info.max
    ):
        raise ScenarioError(f"{where}: expected a finite number, got {value!r:.40}")
    return float(value)


def _value(where: str, key: str, value: Any) -> Any:
    """One checked value of a scenario."""
    if key in SHAPES:
        return SHAPES[key](where, value)
    if key == "circles":
        if not isinstance(value, list):
            raise ScenarioError(
                f"{where}: expected a list of [x, y, radius] or [x, y, radius, vx, vy], "
                f"got {value!r}"
            )
        circles = []
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) not in (3, 5):
                raise ScenarioError(
                    f"{where}: circle {i}: expected [x, y, radius] or [x, y, radius, vx, vy], "
                    f"got {row!r}"
                )
            try:
                circles.append(Circle(*(_number(f"{where}: circle {i}", v) for v in row)))
            except ProblemError as error:
                raise ScenarioError(f"{where}: circle {i}: {error}") from error
        return tuple(circles)
    if key == "floors":
        if not isinstance(value, list) or any(
            not isinstance(row, list) or len(row) != len(Floor._fields) for row in value
        ):
            raise ScenarioError(
                f"{where}: expected a list of [time, slip, turn_gain], got {value!r}"
            )
        return tuple(
            Floor(
                *(
                    _value(f"{where}: floor {i}", name, v)
                    for name, v in zip(Floor._fields, row, strict=True)
                )
            )
            for i, row in enumerate(value)
        )
    if key in GROUND_ROWS:
        kinds = GROUND_ROWS[key]
        if not isinstance(value, list) or any(
            not isinstance(row, list) or len(row) != len(kinds) for row in value
        ):
            raise ScenarioError(f"{where}: expected a list of [{', '.join(kinds)}], got {value!r}")
        return tuple(
            tuple(
                _value(where, "ground" if k == "name" else k, v)
                for k, v in zip(kinds, row, strict=True)
            )
            for row in value
        )
    if key == "ground":
        if not isinstance(value, str):
            raise ScenarioError(f"{where}: expected the name of a floor, got {value!r}")
        return value
    if key in ("x", "y"):
        return _number(where, value)
    if key == "du_max" and value == []:
        return None
    if key in FLOAT_LISTS:
        if not isinstance(value, list) or len(value) != FLOAT_LISTS[key]:
            raise ScenarioError(f"{where}: expected {FLOAT_LISTS[key]} numbers, got {value!r}")
        numbers = tuple(_number(where, v) for v in value)
        if key == "du_max" and min(numbers) <= 0:
            raise ScenarioError(f"{where}: expected numbers > 0, got {value!r}")
        if key == "pose_noise" and min(numbers) < 0:
            raise ScenarioError(f"{where}: expected numbers >= 0, got {value!r}")
        return numbers
    if key == "seed":
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ScenarioError(f"{where}: expected a whole number >= 0, got {value!r}")
        return value
    number = _number(where, value)
    if number < 0 or (key in POSITIVE and number == 0):
        raise ScenarioError(
            f"{where}: expected a number {'>' if key in POSITIVE else '>='} 0, got {value!r}"
        )
    if number > LARGEST.get(key, number):
        raise ScenarioError(f"{where}: expected at most {LARGEST[key]:g}, got {value!r}")
    return number
