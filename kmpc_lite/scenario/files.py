"""Scenario files: a map, a robot, a plant and how long to try.

A scenario is TOML; the ones that come with the package are named by their stem (``mehrez``,
``four_circles_1``, ...).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.wheels import Wheels, read_wheels, wheels_to_table
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall
from kmpc_lite.errors import ProblemError, ScenarioError, did_you_mean
from kmpc_lite.reading import read_toml
from kmpc_lite.scenario.bundled import bundled, bundled_file
from kmpc_lite.scenario.overrides import NO_AREA, area_around
from kmpc_lite.scenario.touch import ARRIVED, Tolerance
from kmpc_lite.scenario.values import (
    CONTROLLER,
    KEYS,
    LIDAR,
    Floor,
    LidarSpec,
    check_keys,
    grid_to_toml,
    lidar_to_toml,
    options_to_toml,
    read_lidar,
    read_options,
    to_toml,
)
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids


@dataclass(frozen=True, eq=False)
class Scenario:
    """One drive: where, past what, on which floor.

    Lengths in m, angles in rad, times in s; frame ENU, heading counter-clockwise from east.
    """

    name: str
    bounds: tuple[float, float, float, float]
    """xmin, ymin, xmax, ymax of the robot's centre. Not given in a file: of the grid, if there is
    one, else of the pictures alone."""
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
    """Floor under the digital twin, by its name: `kmpc_lab.sim.twin.FLOORS`."""
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
    """How long each goal may take [s]."""
    tolerance: float = ARRIVED.distance
    """Distance to the goal [m] that counts as arrived."""
    heading_tolerance: float = ARRIVED.heading
    """Heading error [rad] that counts as arrived."""
    margin: float = 0.0
    """Distance [m] that the controller is asked to keep beyond the radii."""
    du_max: tuple[float, float] | None = None
    """How fast commands may change [m/s^2, rad/s^2]; as the problem has it if not given. In a
    file [] is the same."""
    R: tuple[float, ...] | None = None
    """Weights of the commands [1/(m/s)^2, 1/(rad/s)^2]; the controller's own if not given. In a
    file, [weights], [] is the same."""
    R_change: tuple[float, ...] | None = None
    """Weights of their changes from period to period, likewise."""
    wheels: tuple[float, float] | Wheels | None = None
    """Distance between the wheels [m] and how fast one turns at its rim [m/s], where they limit
    speed and turn rate together; or the kind of the wheels. As the problem has it if not given.
    In a file [] is the same, and kinds are "omni" or tables like {kind = "car",
    turning_radius = 0.6}."""
    turning_point: tuple[float, float] = (0.0, 0.0)
    """Where the point lies about which the plant turns on the spot, as seen from its pose: ahead,
    left [m]."""
    polygons: tuple[Polygon, ...] = ()
    walls: tuple[Wall, ...] = ()
    grid: OccupancyGrid | None = None
    """In a file the path of a map.yaml, from the file's own folder, or a table with rows that draw
    it."""
    options: ControllerOptions = ControllerOptions()
    """What the controller is tuned with; in a file tables [controller.ROOM]."""
    has_area: bool = True
    """Whether the robot has to stay within `bounds`."""
    lidar: LidarSpec | None = None
    """By what a simulated robot sees; without one, all obstacles are known."""
    via: tuple[tuple[float, float, float], ...] = ()
    """Goals that are to be held before `goal`, in this order."""
    loop: bool = False
    """Whether the first of the goals follows the last one, until time is up."""
    footprint: Footprint | None = None
    """What the robot covers, where that is no circle about its pose; `radius` then follows from it.
    In a file a table of length, width and ahead, or a list of corners."""

    def __post_init__(self) -> None:
        if self.footprint is not None:
            object.__setattr__(self, "radius", self.footprint.radius)
        x_min, y_min, x_max, y_max = self.bounds
        if x_min >= x_max or y_min >= y_max:
            raise ScenarioError(
                f"{self.name}: [map] bounds: expected xmin < xmax and ymin < ymax, "
                f"got {list(self.bounds)}"
            )
        check_place(self, "start", self.start)
        for goal in self.goals:
            check_place(self, "goal", goal)
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
            table = read_toml(path)
        except OSError as error:
            raise ScenarioError(
                f"{path}: cannot read the scenario: {error.strerror or error}"
            ) from error
        except ValueError as error:
            raise ScenarioError(f"{path}: not TOML: {error}") from error
        area = table.get("map")
        if isinstance(area, dict) and isinstance(grid := area.get("grid"), str) and grid:
            area["grid"] = str(path.parent / grid)
        return cls.from_table(table, path.stem, str(path))

    @classmethod
    def from_table(cls, table: Mapping[str, Any], name: str, where: str) -> Scenario:
        """Check a parsed scenario, section by section."""
        check_keys(where, table, (LIDAR, CONTROLLER))
        values: dict[str, Any] = {}
        for section, keys in KEYS.items():
            given = table.get(section, {})
            for key, (default, read) in keys.items():
                place = f"{where}: [{section}] {key}"
                if key not in given and default is None:
                    raise ScenarioError(f"{place}: missing")
                values[key] = read(place, given.get(key, default))
        if not values["bounds"]:
            values["bounds"], values["has_area"] = area_around(values)
        options = read_options(f"{where}: [{CONTROLLER}]", table.get(CONTROLLER, {}))
        lidar = read_lidar(f"{where}: [{LIDAR}]", table.get(LIDAR))
        return cls(name=name, options=options, lidar=lidar, **values)

    def to_toml(self) -> str:
        """Render as a scenario file that `load` reads back."""
        wheels, outline = self.wheels, self.footprint
        values = {
            **self.__dict__,
            "circles": [list(c) if c.vx or c.vy else list(c[:3]) for c in self.circles],
            "polygons": [p.vertices for p in self.polygons],
            "walls": [[w.x1, w.y1, w.x2, w.y2, w.thickness] for w in self.walls],
            "wheels": wheels if wheels is None or isinstance(wheels, tuple) else
                      wheels_to_table(wheels),
            "footprint": None if outline is None else outline.corners,
            "bounds": self.bounds if self.has_area else None,
            "radius": self.radius if outline is None else None,
        }  # fmt: skip
        lines: list[str] = []
        for section, keys in KEYS.items():
            told = {key: values[key] for key in keys if key != "grid" and values[key] is not None}
            lines += [f"[{section}]", *(f"{key} = {to_toml(v)}" for key, v in told.items())]
            if section == "map" and self.grid is not None:
                lines.append(f"grid = {grid_to_toml(self.grid)}")
            lines.append("")
        more = (*lidar_to_toml(self.lidar), *options_to_toml(self.options.changed()))
        return "\n".join([*lines, *more])

    def problem(self, base: NavigationProblem | None = None) -> NavigationProblem:
        """Navigation problem of this map and robot, the rest as in `base` or the paper."""
        x_min, y_min, x_max, y_max = self.bounds if self.has_area else NO_AREA
        base = base or NavigationProblem()
        track, max_wheel_speed = base.track, base.max_wheel_speed
        if isinstance(self.wheels, tuple):
            track, max_wheel_speed = self.wheels
        elif self.wheels is not None:
            base = base.with_wheels(self.wheels)
        try:
            return replace(
                base,
                x_min=(x_min, y_min, -np.inf),
                x_max=(x_max, y_max, np.inf),
                robot_radius=self.radius,
                footprint=self.footprint,
                margin=self.margin,
                du_max=base.du_max if self.du_max is None else self.du_max,
                R=base.R if self.R is None else self.R,
                R_change=base.R_change if self.R_change is None else self.R_change,
                track=track,
                max_wheel_speed=max_wheel_speed,
            )
        except ProblemError as error:
            raise ScenarioError(f"{self.name}: {error}") from error

    def of_robot(self, info: Mapping[str, Any]) -> Scenario:
        """Return the same for the robot that a model was learned from, as its `info` tells it.

        Wheels that the scenario names stay; a radius or an outline that `fit` was told is the
        robot's.
        """
        told: dict[str, Any] = {}
        if self.wheels is None and (wheels := learned_wheels(info)) is not None:
            told["wheels"] = wheels
        if "footprint" in info:
            told["footprint"] = Footprint.of(info["footprint"])
        elif "radius" in info and self.footprint is None:
            told["radius"] = float(info["radius"])
        return replace(self, **told) if told else self

    @property
    def goals(self) -> tuple[tuple[float, float, float], ...]:
        """All goals, in the order in which they are to be held."""
        return (*self.via, self.goal)

    @property
    def arrival(self) -> Tolerance:
        """What counts as arrived."""
        return Tolerance(self.tolerance, self.heading_tolerance)

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
    from kmpc_lite.control.world.solids import Solids

    return Solids(found)


def learned_wheels(info: Mapping[str, Any]) -> Wheels | None:
    """Wheels of the robot that a model was learned from; none if its `info` does not tell them."""
    table = info.get("wheels", {})
    told = "turning_radius" in table or table.get("kind") == "omni"
    return read_wheels(table) if told else None


def check_place(
    scenario: Scenario, key: Literal["start", "goal"], pose: tuple[float, float, float]
) -> None:
    """Raise ScenarioError if the robot cannot stand at a pose (3,), its start or a goal."""
    x_min, y_min, x_max, y_max = scenario.bounds
    x, y, _ = pose
    where = f"{scenario.name}: [robot] {key}"
    if scenario.has_area and not (x_min <= x <= x_max and y_min <= y <= y_max):
        raise ScenarioError(
            f"{where}: ({x:g}, {y:g}) lies outside the bounds {list(scenario.bounds)}"
        )
    if scenario.footprint is not None:
        _check_footprint(scenario, scenario.footprint, key, np.array(pose))
        return
    for i, circle in enumerate(scenario.circles):
        distance = float(np.hypot(x - circle.x, y - circle.y))
        moving = circle.vx != 0.0 or circle.vy != 0.0
        if distance < circle.radius + scenario.radius and not (moving and key == "goal"):
            raise ScenarioError(
                f"{where}: ({x:g}, {y:g}) is {distance:g} m from the centre of circle {i}, "
                f"but the radii add up to {circle.radius + scenario.radius:g} m"
            )
    if scenario.solids is not None:
        gap = float(scenario.solids.whole.least(np.array([[x, y]]))[0])
        if gap < scenario.radius:
            raise ScenarioError(
                f"{where}: ({x:g}, {y:g}) is {gap:g} m from a polygon, wall or grid cell, "
                f"but the robot's radius is {scenario.radius:g} m"
            )


def _check_footprint(scenario: Scenario, footprint: Footprint, key: str, pose: Array) -> None:
    # here, since most robots are round
    from kmpc_lite.scenario.touch import footprint_gaps

    circles = [c for c in scenario.circles if key == "start" or not (c.vx or c.vy)]
    solids = () if scenario.solids is None else scenario.solids.solids
    rows = np.array(circles, dtype=float).reshape(1, -1, 5)
    gap = float(footprint_gaps(footprint, pose[None], rows, solids)[0])
    if gap < 0.0:
        raise ScenarioError(
            f"{scenario.name}: [robot] {key}: at ({pose[0]:g}, {pose[1]:g}, {pose[2]:g}) the "
            f"footprint overlaps an obstacle by {-gap:g} m"
        )
