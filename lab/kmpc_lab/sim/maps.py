"""Random maps of the studies: families of circles and solids, each by its seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

BOUNDS = (-2.0, -2.0, 2.0, 2.0)
ROBOT_RADIUS = 0.15
Random = np.random.Generator
CELL = 0.05  # side of the cells of the rooms' grid [m]
ROOM = 3.9  # sides of the house, outer walls included [m]
WALL, DOOR = 0.10, (0.56, 0.75)
"""Thickness of the walls inside, and least and largest width of a door [m]."""
PASSAGE = 0.1  # distance that the passage keeps beyond the radii [m]
FINE_CELL = 0.02  # side of the cells of the grid on which passages are looked for [m]
ATTEMPTS = 1000


class Layout(NamedTuple):
    """One draw; it may well lack a passage."""

    circles: Array  # (M, 5) rows x, y, radius, vx, vy
    start: Array  # (3,)
    goal: Array  # (3,)
    polygons: tuple[Polygon, ...] = ()
    walls: tuple[Wall, ...] = ()
    grid: OccupancyGrid | None = None

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Polygons, walls and the grid."""
        return (*self.polygons, *self.walls, *(() if self.grid is None else (self.grid,)))


def draw_ends(random: Random) -> tuple[Array, Array]:
    """Start and goal anywhere in the area, at least 2 m apart, with any headings."""
    while True:
        start, goal = random.uniform(-1.8, 1.8, (2, 3))
        start[2], goal[2] = random.uniform(-np.pi, np.pi, 2)
        if np.hypot(*(goal - start)[:2]) >= 2.0:
            return start, goal


def at_rest(positions: Array, radii: Array) -> Array:
    """Circles (M, 5) that do not move."""
    return np.column_stack([positions, radii, np.zeros((len(radii), 2))])


def draw_polygons(random: Random) -> Layout:
    """Four to seven convex polygons of 3 to 7 corners, and up to two circles."""
    polygons = []
    for _ in range(int(random.integers(4, 8))):
        # corners on an ellipse are convex; apart, so that none is cut off to nothing
        angles = np.cumsum(random.uniform(0.5, 1.0, int(random.integers(3, 8))))
        angles *= 2 * np.pi / (angles[-1] + random.uniform(0.3, 0.8))
        axes, turn = random.uniform(0.12, 0.45, 2), random.uniform(-np.pi, np.pi)
        local = np.column_stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)])
        polygons.append(Polygon(random.uniform(-1.4, 1.4, 2) + local @ _turned(turn)))
    count = int(random.integers(0, 3))
    circles = at_rest(random.uniform(-1.5, 1.5, (count, 2)), random.uniform(0.10, 0.2, count))
    return Layout(circles, *draw_ends(random), polygons=tuple(polygons))


def draw_walls(random: Random) -> Layout:
    """Four to seven straight walls; every other one begins at an angle in the middle of another.

    They are up to 10 cm thick.
    """
    walls: list[Wall] = []
    for i in range(int(random.integers(4, 8))):
        middle = random.uniform(-1.4, 1.4, 2)
        if i % 2:
            other = walls[-1]
            middle = np.array([0.5 * (other.x1 + other.x2), 0.5 * (other.y1 + other.y2)])
        heading, length = random.uniform(-np.pi, np.pi), random.uniform(0.5, 1.6)
        end = middle + length * np.array([np.cos(heading), np.sin(heading)])
        walls.append(Wall(middle[0], middle[1], end[0], end[1], random.uniform(0.0, 0.1)))
    return Layout(np.empty((0, 5)), *draw_ends(random), walls=tuple(walls))


def draw_rooms(random: Random) -> Layout:
    """A house of three or four rooms with furniture, turned by any angle, as a grid.

    The grid lies along the axes of the map or of the house.
    """
    turn = random.uniform(-np.pi, np.pi)
    split, cross = random.uniform(-0.5, 0.5, 2)
    half = 0.5 * ROOM
    inner = half - WALL
    boxes = [
        (-half, -half, half, -inner),
        (-half, inner, half, half),
        (-half, -half, -inner, half),
        (inner, -half, half, half),
    ]
    boxes += _wall_with_door(random, split, -half, half, along_y=True)
    for low, high in ((-half, split), (split, half))[: int(random.integers(1, 3))]:
        boxes += _wall_with_door(random, cross, low, high, along_y=False)
    for _ in range(int(random.integers(2, 5))):
        corner, size = random.uniform(-half, half - 0.3, 2), random.uniform(0.15, 0.45, 2)
        boxes.append((*corner, *(corner + size)))
    rotation = _turned(turn)
    along_house = bool(random.integers(0, 2))
    reach = half if along_house else half * (abs(np.cos(turn)) + abs(np.sin(turn)))
    cells = int(np.ceil(2 * reach / CELL))
    centres = CELL * (np.arange(cells) + 0.5) - 0.5 * cells * CELL
    x, y = np.meshgrid(centres, centres)
    places = np.stack([x, y], axis=-1)
    if not along_house:
        places = places @ rotation.T
    occupied = np.zeros((cells, cells), dtype=bool)
    for x_min, y_min, x_max, y_max in boxes:
        occupied |= (
            (places[..., 0] >= x_min)
            & (places[..., 0] <= x_max)
            & (places[..., 1] >= y_min)
            & (places[..., 1] <= y_max)
        )
    corner = -0.5 * cells * CELL * np.ones(2)
    origin = (*(corner @ rotation), turn) if along_house else (*corner, 0.0)
    grid = OccupancyGrid(occupied, CELL, origin)
    inside = inner - 0.2
    x = random.uniform(-inside, split - 0.3), random.uniform(split + 0.3, inside)
    ends = np.column_stack([x, random.uniform(-inside, inside, 2)]) @ rotation
    # the corners of a house that stands askew reach beyond the area
    ends = np.clip(ends, BOUNDS[:2], BOUNDS[2:])
    headings = random.uniform(-np.pi, np.pi, 2)
    return Layout(
        np.empty((0, 5)),
        np.append(ends[0], headings[0]),
        np.append(ends[1], headings[1]),
        grid=grid,
    )


def _wall_with_door(
    random: Random, place: float, low: float, high: float, along_y: bool
) -> list[tuple[float, float, float, float]]:
    """Two boxes of a wall at `place` from `low` to `high`, with a door between them."""
    width = random.uniform(*DOOR)
    begin = random.uniform(low + 0.15, high - 0.15 - width)
    parts = [
        (place - 0.5 * WALL, low, place + 0.5 * WALL, begin),
        (place - 0.5 * WALL, begin + width, place + 0.5 * WALL, high),
    ]
    return parts if along_y else [(y0, x0, y1, x1) for x0, y0, x1, y1 in parts]


def _turned(angle: float) -> Array:
    """Matrix (2, 2) that turns rows by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])


@dataclass(frozen=True)
class Family:
    """A kind of map."""

    name: str
    draw: Callable[[Random], Layout]
    timeout: float = 40.0  # [s]
    passage: float = PASSAGE  # [m]


def has_passage(
    circles: Array,
    start: Array,
    goal: Array,
    clearance: float,
    bounds: Array,
    cell: float = FINE_CELL,
    solids: Sequence[Solid] = (),
) -> bool:
    """Whether a point can move from start to goal with `clearance` to all obstacles and bounds.

    Decided on a grid of square cells whose centres are neighbours along the axes, with half a cell
    to spare, so that the lines between the centres keep the clearance too. Never true without a
    passage; one that is a cell wider than needed is found.

    `circles`: (M, 3) or more columns: x, y, radius [m]; velocities are not looked at. `start`,
    `goal`: points (2,), or poses [m]. `clearance`: between the point and the circles' edges [m].
    `bounds`: xmin, ymin, xmax, ymax (4,) [m]. `cell`: distance between neighbours on the grid [m].
    `solids`: what else is there.
    """
    x = np.linspace(bounds[0], bounds[2], 1 + int(np.ceil((bounds[2] - bounds[0]) / cell)))
    y = np.linspace(bounds[1], bounds[3], 1 + int(np.ceil((bounds[3] - bounds[1]) / cell)))
    keep = circles[:, 2] + clearance
    for point in (start, goal):
        if (np.hypot(circles[:, 0] - point[0], circles[:, 1] - point[1]) < keep).any():
            return False
    free = np.ones((len(x), len(y)), dtype=bool)
    for (cx, cy), distance in zip(circles[:, :2], keep + 0.5 * cell, strict=True):
        free &= (x[:, None] - cx) ** 2 + (y[None] - cy) ** 2 >= distance**2
    if solids:
        whole = Solids(solids).whole
        ends = np.stack([start[:2], goal[:2]])
        if (whole.least(ends) < clearance).any():
            return False
        _take_away(free, x, y, solids, clearance + 0.5 * cell)
    labels, _ = ndimage.label(free)

    def nearby(point: Array) -> set[int]:
        """Regions of the cells around a point that a straight line reaches."""
        near = (
            np.flatnonzero(np.abs(x - point[0]) <= cell),
            np.flatnonzero(np.abs(y - point[1]) <= cell),
        )
        return {int(v) for v in labels[np.ix_(*near)].ravel()} - {0}

    return bool(nearby(start) & nearby(goal))


def _take_away(
    free: NDArray[np.bool_], x: Array, y: Array, solids: Sequence[Solid], keep: float
) -> None:
    """Clear the cells of `free` (X, Y) whose centres are nearer than `keep` to a solid."""
    whole = Solids(solids).whole
    for row, at in zip(free, x, strict=True):
        row &= whole.least(np.column_stack([np.full(len(y), at), y])) >= keep


def random_map(family: str, seed: int, slip: float = 0.0) -> Scenario:
    """Draw a map of a family; the same seed gives the same map, and the plant's noise too.

    `family`: one of `FAMILIES`. `seed`: below 500,000 for tuning; reported figures use 500,000 and
    above. `slip`: of the plant. Raises ScenarioError for an unknown family, or if no draw has a
    passage.
    """
    if family not in FAMILIES:
        raise ScenarioError(
            f"no family of maps named {family!r}; expected one of {', '.join(FAMILIES)}"
        )
    kind = FAMILIES[family]
    random = np.random.default_rng([seed, sum(family.encode())])
    for _ in range(ATTEMPTS):
        layout = kind.draw(random)
        circles, start, goal = layout[:3]
        if has_passage(
            circles,
            start,
            goal,
            ROBOT_RADIUS + kind.passage,
            np.array(BOUNDS),
            solids=layout.solids,
        ):
            return Scenario(
                name=f"{family}-{seed}",
                bounds=BOUNDS,
                circles=tuple(Circle(*(float(v) for v in row)) for row in circles),
                radius=ROBOT_RADIUS,
                start=(float(start[0]), float(start[1]), float(start[2])),
                goal=(float(goal[0]), float(goal[1]), float(goal[2])),
                slip=slip,
                seed=seed,
                timeout=kind.timeout,
                polygons=layout.polygons,
                walls=layout.walls,
                grid=layout.grid,
            )
    raise ScenarioError(f"{family}-{seed}: no map with a passage in {ATTEMPTS} draws")


def _scattered(least: int, most: int) -> Callable[[Random], Layout]:
    def draw(random: Random) -> Layout:
        count = int(random.integers(least, most + 1))
        return Layout(
            at_rest(random.uniform(-1.5, 1.5, (count, 2)), random.uniform(0.10, 0.28, count)),
            *draw_ends(random),
        )

    return draw


def _trap(random: Random) -> Layout:
    """A U of circles that opens towards the start, the goal behind its bottom."""
    axis, radius = random.uniform(-np.pi, np.pi), random.uniform(0.10, 0.16)
    width, depth = random.uniform(0.9, 1.3), random.uniform(0.6, 1.0)
    spacing = 1.6 * radius
    bottom = np.arange(-width / 2, width / 2 + 0.5 * spacing, spacing)
    arm = np.arange(spacing, depth, spacing)
    local = np.concatenate(
        [
            np.column_stack([np.zeros_like(bottom), bottom]),
            np.column_stack([-arm, np.full_like(arm, bottom[0])]),
            np.column_stack([-arm, np.full_like(arm, bottom[-1])]),
        ]
    )
    along = np.array([np.cos(axis), np.sin(axis)])
    across = np.array([-along[1], along[0]])
    centre = random.uniform(-0.2, 0.2, 2) + 0.3 * along
    positions = centre + local @ np.stack([along, across])
    start = np.append(
        centre - random.uniform(0.9, 1.5) * along + random.uniform(-0.2, 0.2) * across,
        random.uniform(-np.pi, np.pi),
    )
    goal = np.append(
        centre + random.uniform(0.5, 1.1) * along + random.uniform(-0.3, 0.3) * across,
        random.uniform(-np.pi, np.pi),
    )
    return Layout(at_rest(positions, np.full(len(positions), radius)), start, goal)


def _corridor(random: Random) -> Layout:
    """Two or three walls of circles across the area, each with one gap."""
    axis = random.integers(0, 2)
    rows = []
    for place in np.linspace(-1.0, 1.0, int(random.integers(2, 4))):
        radius = random.uniform(0.10, 0.14)
        # between the edges of the circles beside the gap: 10 cm on either side of the robot at the
        # least
        opening, middle = random.uniform(0.52, 0.62), random.uniform(-1.4, 1.4)
        spots = np.arange(-2.0, 2.0 + radius, 1.5 * radius)
        spots = spots[np.abs(spots - middle) >= opening / 2 + radius]
        wall = np.column_stack([np.full_like(spots, place), spots])
        rows.append(at_rest(wall[:, ::-1] if axis else wall, np.full(len(spots), radius)))
    ends = np.stack([random.uniform(-1.8, -1.5, 2), random.uniform(-1.5, 1.5, 2)], axis=1)
    ends[1, 0] *= -1.0
    ends = ends[:, ::-1] if axis else ends
    headings = random.uniform(-np.pi, np.pi, 2)
    return Layout(
        np.concatenate(rows), np.append(ends[0], headings[0]), np.append(ends[1], headings[1])
    )


def _moving(random: Random) -> Layout:
    """Two to four circles at rest, and two or three that cross at up to 0.3 m/s.

    The moving ones keep away from the goal: they have passed it, or never come near, so that a
    robot may stay there.
    """
    start, goal = draw_ends(random)
    still = int(random.integers(2, 5))
    rows = at_rest(random.uniform(-1.5, 1.5, (still, 2)), random.uniform(0.10, 0.25, still))
    moving: list[Array] = []
    times = np.linspace(0.0, 60.0, 601)
    while len(moving) < 2 + int(still % 2):
        radius, speed = random.uniform(0.10, 0.2), random.uniform(0.1, 0.3)
        bearing, heading = random.uniform(-np.pi, np.pi, 2)
        position = random.uniform(1.0, 2.2) * np.array([np.cos(bearing), np.sin(bearing)])
        velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        track = position + times[:, None] * velocity
        from_goal = np.hypot(*(track - goal[:2]).T).min()
        from_start = np.hypot(*(track[:40] - start[:2]).T).min()
        # it comes through the middle, or it is no test
        if (
            min(from_goal, from_start) >= radius + ROBOT_RADIUS + 0.3
            and np.hypot(*track.T).min() < 1.0
        ):
            moving.append(np.array([*position, radius, *velocity]))
    return Layout(np.concatenate([rows, moving]), start, goal)


FAMILIES = {
    f.name: f
    for f in (
        Family("open", _scattered(4, 9)),
        Family("dense", _scattered(10, 14)),
        Family("narrow", _scattered(10, 14), passage=0.06),
        Family("trap", _trap, timeout=60.0),
        Family("corridor", _corridor, timeout=60.0),
        Family("moving", _moving, timeout=60.0),
        Family("polygons", draw_polygons),
        Family("walls", draw_walls, timeout=60.0),
        Family("rooms", draw_rooms, timeout=60.0),
    )
}
"""``open``: 4 to 9 circles of 0.10 to 0.28 m; ``dense``: 10 to 14; ``narrow``: 10 to 14 and a
passage of 6 cm only; ``trap``: a U that opens towards the start; ``corridor``: walls with one gap
each; ``moving``: circles that cross at up to 0.3 m/s; ``polygons``: 4 to 7 and some circles;
``walls``: 4 to 7 walls, some joined; ``rooms``: a house as an occupancy grid."""
