"""Worlds of cylinders from a cellular automaton, and worlds of moving ones.

The field is drawn as Perille et al. publish it ("Benchmarking Metric Ground Navigation", 2020):
30 x 30 cells of 0.15 m, 15 to 30 % filled, two to four rounds of smoothing (five filled neighbours
fill a cell, at most one clears it), walls of cylinders along both sides, and none that has no way
through. The moving cylinders follow Nair et al. ("DynaBARN", 2022): curves across a square, at a
speed that changes from leg to leg.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from kmpc_lab.studies.sight.pursuit import cost_to_go
from kmpc_lite.errors import DataError
from kmpc_lite.types import Array

CELL = 0.15
"""Diameter of a cylinder, and side of a cell [m]."""
ROWS = 30
"""Cells along each side of the field."""
FILLS, SMOOTHINGS = (0.15, 0.20, 0.25, 0.30), (2, 3, 4)
"""Parameters of the twelve kinds of field; the public set has 25 of each."""
YARD = 5.0
"""Length of the free yard before the field [m]."""
PASSAGE = 0.34
"""Distance between the robot's middle and cylinders that a way through keeps [m]: it may turn on
the spot anywhere."""
GRID = 0.05
"""Side of the cells on which a way through is looked for [m]."""
ATTEMPTS = 3000
QUARTER = 0.5 * math.pi


@dataclass(frozen=True)
class Cylinders:
    """A world, where from and where to."""

    name: str
    ways: tuple[Array, ...]
    """Of each cylinder (K, 3) rows time, x, y [s, m], driven again and again; one row: at rest."""
    radius: float
    """Of every cylinder [m]."""
    start: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    bounds: tuple[float, float, float, float]
    """xmin, ymin, xmax, ymax of the area [m]."""
    length: float
    """Of the way that the metric reckons with [m]."""

    def circles_at(self, time: float) -> Array:
        """Rows x, y, radius, vx, vy (M, 5) at a time [s]."""
        rows = np.zeros((len(self.ways), 5))
        rows[:, 2] = self.radius
        if len(self.ways[0]) == 1:
            rows[:, :2] = np.concatenate(self.ways)[:, 1:]
            return rows
        for row, way in zip(rows, self.ways, strict=True):
            at = time % way[-1, 0]
            leg = min(int(np.searchsorted(way[:, 0], at, "right")), len(way) - 1)
            velocity = (way[leg, 1:] - way[leg - 1, 1:]) / (way[leg, 0] - way[leg - 1, 0])
            row[:2] = way[leg - 1, 1:] + (at - way[leg - 1, 0]) * velocity
            row[3:] = velocity
        return rows


def draw_field(seed: int) -> Cylinders:
    """Draw the field of a seed: one of the twelve kinds in turn, with a way through."""
    kind = seed % (len(FILLS) * len(SMOOTHINGS))
    fill, rounds = FILLS[kind // len(SMOOTHINGS)], SMOOTHINGS[kind % len(SMOOTHINGS)]
    random = np.random.default_rng([seed, 73])
    for _ in range(ATTEMPTS):
        world = of_places(f"field {seed}", _places(_automaton(random, fill, rounds)))
        if world is not None:
            return world
    raise DataError(f"no field of seed {seed} has a way through")


def _automaton(random: np.random.Generator, fill: float, rounds: int) -> Array:
    """Filled cells (ROWS, ROWS) along y and x; the first and last column are walls."""
    filled = random.random((ROWS, ROWS)) < fill
    filled[:, [0, -1]] = True
    around = np.ones((3, 3), dtype=int)
    around[1, 1] = 0
    for _ in range(rounds):
        # beyond the walls all is filled; before and behind the field nothing is
        padded = np.pad(filled, ((0, 0), (1, 1)), constant_values=True).astype(int)
        near = ndimage.convolve(padded, around, mode="constant")[:, 1:-1]
        filled = (near >= 5) | (filled & (near > 1))
    return filled


def _places(filled: Array) -> Array:
    """Middles (M, 2) of cylinders: the field's, and the walls of the yard before it."""
    side = ROWS * CELL
    along = np.arange(0.5 * CELL, YARD, CELL)
    across = np.arange(-side - 0.5 * CELL, 0.0, CELL)
    row, column = np.nonzero(filled)
    return np.concatenate(
        [
            np.stack([across, np.full(len(across), 0.5 * CELL)], axis=1),
            *(np.stack([np.full(len(along), x), along], 1) for x in (across[0], across[-1])),
            np.stack([across[0] + CELL * column, along[-1] + CELL * (row + 1)], axis=1),
        ]
    )


def of_places(name: str, places: Array, length: float = 0.0) -> Cylinders | None:
    """The course of the challenge through cylinders (M, 2); None if there is no way through.

    A length of 0 stands for that of the shortest way through.
    """
    start, goal = np.array([-2.25, 3.0, QUARTER]), np.array([-2.25, 13.0, QUARTER])
    bounds = (-6.75, 0.0, 2.25, 15.0)
    low, cells = np.array(bounds[:2]), (np.array(bounds[2:]) - bounds[:2]) / GRID
    hits = np.zeros((round(cells[1]), round(cells[0])), dtype=bool)
    column, row = np.floor((places - low) / GRID).astype(int).T
    hits[row, column] = True
    # middles of cylinders are middles of cells: the distances are exact
    free = ndimage.distance_transform_edt(~hits) * GRID - 0.5 * CELL >= PASSAGE
    begin, end = (
        tuple(np.floor((pose[1::-1] - low[::-1]) / GRID).astype(int)) for pose in (start, goal)
    )
    parts, _ = ndimage.label(free, np.ones((3, 3)))
    if not parts[begin] or parts[begin] != parts[end]:
        return None
    shortest = GRID * float(cost_to_go(free, end)[begin])
    ways = tuple(np.array([[0.0, *place]]) for place in places)
    return Cylinders(name, ways, 0.5 * CELL, start, goal, bounds, length or shortest)


def read_barn(folder: Path, number: int) -> Cylinders:
    """Read ``world_N.world`` of the public set, and ``path_N.npy`` where it is there.

    `folder`: holds the worlds, or the folder ``world_files`` of them; paths beside them or in
    ``path_files``. `number`: of the world. Raises DataError: names the file, what was expected and
    what came.
    """
    file = _found(folder, "world_files", f"world_{number}.world")
    if file is None:
        raise DataError(f"{folder}: expected world_{number}.world, found no such file")
    text = file.read_text(encoding="utf-8", errors="replace").split("<state", 1)[0]
    pattern = r"<model name='unit_cylinder_\d+'>.*?<pose[^>]*>\s*(\S+)\s+(\S+)\s"
    try:
        places = np.array(re.findall(pattern, text, re.DOTALL), dtype=float).reshape(-1, 2)
    except ValueError as error:
        raise DataError(f"{file}: expected poses of cylinders in numbers, got {error}") from error
    if not len(places):
        raise DataError(f"{file}: expected models named unit_cylinder_N, got none")
    if not (np.isfinite(places).all() and (places[:, 0] > -6.75).all()):
        raise DataError(f"{file}: expected cylinders within the challenge's area")
    path, length = _found(folder, "path_files", f"path_{number}.npy"), 0.0
    if path is not None:
        steps = np.load(path, allow_pickle=False) * CELL + (-4.575, YARD + 0.5 * CELL)
        points = np.concatenate([[(-2.25, 3.0)], steps, [(-2.25, 13.0)]])
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    world = of_places(f"BARN {number}", places, length)
    if world is None:
        raise DataError(f"{file}: expected a way through for the robot, found none")
    return world


def _found(folder: Path, inner: str, name: str) -> Path | None:
    places = folder / name, folder / inner / name, folder.parent / inner / name
    return next((place for place in places if place.is_file()), None)


SQUARE = 10.0
"""Half of the side of the square in which cylinders move [m]."""
MOVING_RADIUS = 0.5
"""Of a moving cylinder [m]."""
LEVELS = ((8, (0.3, 0.7), 1), (12, (0.4, 1.0), 2), (16, (0.5, 1.5), 3))
"""Easy, medium, hard: how many, their speeds [m/s], and the order of their curves."""


def draw_moving(seed: int) -> Cylinders:
    """Draw cylinders that cross a square, and a robot that crosses it, too."""
    count, speeds, order = LEVELS[seed % len(LEVELS)]
    random = np.random.default_rng([seed, 79])
    start, goal = np.array([11.0, 0.0, math.pi]), np.array([-9.0, 0.0, math.pi])
    ways: list[Array] = []
    while len(ways) < count:
        way = _curve(random, speeds, order)
        # none begins within reach of where the robot stands
        begins = np.hypot(way[:, 1] - start[0], way[:, 2] - start[1])
        if begins[:2].min() > 3.0:
            ways.append(way)
    bounds = (-12.0, -12.0, 13.0, 12.0)
    return Cylinders(f"moving {seed}", tuple(ways), MOVING_RADIUS, start, goal, bounds, 20.0)


def _curve(random: np.random.Generator, speeds: tuple[float, float], order: int) -> Array:
    """Rows time, x, y (K, 3) to and fro on a polynomial across the square."""
    places = random.uniform(-SQUARE, SQUARE, (2, order + 1))
    places[0] = np.linspace(-SQUARE, SQUARE, order + 1)
    at = np.linspace(-SQUARE, SQUARE, 12)
    curve = np.polynomial.Polynomial.fit(places[0], places[1], order)
    across = np.clip(curve(at), -SQUARE, SQUARE)
    points = np.stack([at, across], axis=1)[:, :: int(random.choice([-1, 1]))]
    if random.random() < 0.5:
        points = points[::-1]
    points = np.concatenate([points, points[-2::-1]])
    legs = np.hypot(*np.diff(points, axis=0).T) / random.uniform(*speeds, len(points) - 1)
    times = np.concatenate([[0.0], np.cumsum(legs)])
    return np.column_stack([times, points])
