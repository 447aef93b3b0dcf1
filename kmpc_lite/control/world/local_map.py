"""The map of what scans have shown around the robot: cells that are free, occupied, or unknown.

It is plain data, which copies and pickles. All lengths are in the robot's units.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.footprint import Footprint, places_of
from kmpc_lite.types import Array

UNKNOWN = -1  # state of a cell of which nothing is known; see `LocalMap.state`
IN_VAIN = UNKNOWN - 10
"""State of cells at which so many scans in a row have looked in vain: something is there that tells
nothing, such as a pane of glass, and paths lead around it."""
NEVER = -np.inf  # before every time; see `LocalMap.taken`
EMPTY = ("state", UNKNOWN), ("seen", 0.0), ("extent", 0.0), ("taken", NEVER)
"""What is told of cells of which nothing is known."""
NO_POSES = np.empty((0, 4))
Window = tuple[int, int, int, int]  # first row and the one behind the last, the same of columns


def window_between(
    low: tuple[float, float],
    high: tuple[float, float],
    place: tuple[float, int, int],
    shape: tuple[int, int],
) -> Window:
    """Rows and columns of the cells between two corners, of a map of so many rows and columns."""
    (left, bottom), (right, top), (height, width) = low, high, shape
    cell, column, row = place
    bottom, left = math.floor(bottom / cell) - row, math.floor(left / cell) - column
    top, right = math.floor(top / cell) - row + 1, math.floor(right / cell) - column + 1
    rows = min(max(bottom, 0), height), min(max(top, 0), height)
    return *rows, min(max(left, 0), width), min(max(right, 0), width)


@dataclass(slots=True)
class LocalMap:
    """Cells along the axes of the world; row and column count with y and x."""

    cell: float  # side of a cell
    column: int
    """Of the map's first column among all columns of the world: its side lies at column * cell."""
    row: int  # the same of the first row
    state: NDArray[np.int8]
    """(H, W) UNKNOWN, and less by the scans that have looked there in vain; 0: seen to be free;
    n: occupied, until n more scans have passed through."""
    seen: NDArray[np.float32]  # (H, W) when it was seen last, on `clock`
    extent: NDArray[np.float32]
    """(H, W, 4) box around the hits of the last step that hit a cell, and around where they may
    be for their noise: its lower and upper corner, from the cell's lower one."""
    taken: NDArray[np.float32]
    """(H, W) when an occupied cell was hit that was free until then, on `clock`."""
    is_fixed: bool  # whether it holds the whole area, so that it need not follow the robot
    clock: float = 0.0  # time since the map was begun
    forgotten: float = 0.0  # when cells were forgotten last
    trail: Array = field(default_factory=lambda: NO_POSES)
    """(K, 4) time and pose of the steps before."""
    outlooks: Array = field(default_factory=lambda: np.empty((0, 5)))
    """(S, 5) where scanners look (`outlook_of`), and when each has told something last, on
    `clock`."""

    @classmethod
    def around(cls, low: Array, high: Array, cell: float, is_fixed: bool) -> LocalMap:
        """Begin a map, of which nothing is known, from a corner (2,) to another."""
        column, row = np.floor(low / cell).astype(int).tolist()
        width, height = (np.ceil(high / cell).astype(int) - (column, row)).tolist()
        shape = height, width
        return cls(
            cell,
            column,
            row,
            np.full(shape, UNKNOWN, dtype=np.int8),
            np.zeros(shape, dtype=np.float32),
            np.zeros((*shape, 4), dtype=np.float32),
            np.full(shape, NEVER, dtype=np.float32),
            is_fixed,
        )

    @property
    def corner(self) -> Array:
        """Where the first cell begins (2,)."""
        return self.cell * np.array([self.column, self.row])

    def follow(self, point: Array, reach: float) -> None:
        """Move the map along, where a point (2,) lies too near to its edge.

        One that holds the whole area stays, unless what lies within a reach of the point is not on
        it: a robot outside its area takes the map along from then on.
        """
        height, width = self.state.shape
        if self.is_fixed:
            low = self.corner + reach
            high = self.corner + self.cell * np.array((width, height)) - reach
            self.is_fixed = bool(((point >= low) & (point <= high)).all())
        if self.is_fixed:
            return
        column, row = np.floor(point / self.cell).astype(int).tolist()
        inside_x = width // 4 <= column - self.column < width - width // 4
        inside_y = height // 4 <= row - self.row < height - height // 4
        if inside_x and inside_y:
            return
        to_column, to_row = column - width // 2, row - height // 2
        right, up = to_column - self.column, to_row - self.row
        for name, empty in EMPTY:
            setattr(self, name, _shifted(getattr(self, name), up, right, empty))
        self.column, self.row = to_column, to_row

    def window(self, point: Array, distance: float) -> Window:
        """Rows and columns of the cells within a distance of a point (2,), along each axis."""
        low, high = (point - distance).tolist(), (point + distance).tolist()
        height, width = self.state.shape
        return window_between(low, high, self.place, (height, width))

    def centres(self, window: Window) -> tuple[Array, Array]:
        """X (W,) and y (H,) of the middles of a window's cells."""
        x = self.cell * (self.column + 0.5 + np.arange(window[2], window[3]))
        y = self.cell * (self.row + 0.5 + np.arange(window[0], window[1]))
        return x, y

    def cells_of(self, points: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Flat numbers (n,) of the cells of points (n, 2), and which points lie on the map."""
        height, width = self.state.shape
        column = np.floor(points[:, 0] / self.cell).astype(np.intp) - self.column
        row = np.floor(points[:, 1] / self.cell).astype(np.intp) - self.row
        inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        row *= width
        row += column
        return np.where(inside, row, 0), inside

    def is_near(self, points: Array, distance: float) -> NDArray[np.bool_]:
        """Which points (n, 2) lie on the map, or no farther from it than a distance."""
        low = self.cell * np.array((self.column, self.row)) - distance
        high = low + self.cell * np.array(self.state.shape[::-1]) + 2.0 * distance
        near = (points >= low) & (points <= high)
        return near[:, 0] & near[:, 1]

    @property
    def place(self) -> tuple[float, int, int]:
        """Side of a cell, and numbers of the first column and row, as kernels take them."""
        return self.cell, self.column, self.row

    def was_free(self, cells: NDArray[np.intp], time: float) -> NDArray[np.bool_]:
        """Whether cells with flat numbers (n,) are free, or were until a time ago at most."""
        state, taken = self.state.ravel()[cells], self.taken.ravel()[cells]
        free: NDArray[np.bool_] = (state == 0) | ((state > 0) & (taken >= self.clock - time))
        return free

    def forget(self, memory: float, blind: float) -> None:
        """Forget what was seen longer ago than the memory reaches; at times, not in each step.

        Scanners that told nothing for longer than `blind` look no more.
        """
        self.outlooks = self.outlooks[self.outlooks[:, 4] >= self.clock - blind]
        if self.clock - self.forgotten < memory / 16:
            return
        self.forgotten = self.clock
        self.state[self.seen < self.clock - memory] = UNKNOWN

    def remember(self, pose: Array, most: int, looks: Iterable[Sequence[float]]) -> None:
        """Remember where the robot (3,) is now, and where scanners look that tell something."""
        for look in looks:
            others = self.outlooks[(self.outlooks[:, :4] != look).any(axis=1)]
            self.outlooks = np.concatenate([others, [[*look, self.clock]]])
        row = np.array([[self.clock, *pose.tolist()]])
        self.trail = np.concatenate([self.trail[-(most - 1) :], row])

    def poses_at(self, ages: Array, after: float = 0.0, now: Array | None = None) -> Array:
        """Where the robot was before, (..., 3): now where an age is zero.

        `now` (3,) is where it is a time after the last pose that was remembered.
        """
        trail, clock = self.trail, self.clock + after
        if now is not None:
            trail = np.concatenate([trail, [[clock, *now.tolist()]]])
        times, poses = trail[:, 0], trail[:, 1:]
        moments = clock - ages
        x, y = (np.interp(moments, times, poses[:, i]) for i in (0, 1))
        heading = np.interp(moments, times, np.unwrap(poses[:, 2]))
        return np.stack([x, y, heading], axis=-1)


def _shifted(cells: NDArray[np.generic], up: int, right: int, empty: float) -> NDArray[np.generic]:
    """Cells (H, W, ...) as seen from a corner that many rows and columns farther up and right."""
    moved = np.full_like(cells, empty)
    height, width = cells.shape[:2]
    if abs(up) < height and abs(right) < width:
        to_rows, rows = _overlap(up, height)
        to_columns, columns = _overlap(right, width)
        moved[to_rows, to_columns] = cells[rows, columns]
    return moved


def _overlap(shift: int, length: int) -> tuple[slice, slice]:
    """Where the cells that stay go to, and where they come from."""
    to = slice(max(-shift, 0), length - max(shift, 0))
    return to, slice(to.start + shift, to.stop + shift)


def cell_distances(
    here: LocalMap, window: Window, footprint: Footprint | None, pose: Array
) -> Array:
    """Distances of the middles of a window's cells from the nearest middle of a robot's circles."""
    x, y = here.centres(window)
    places = places_of(footprint, pose)
    away = np.hypot(x[:, None] - places[:, 0], y[:, None, None] - places[:, 1])
    return np.asarray(away.min(axis=-1))
