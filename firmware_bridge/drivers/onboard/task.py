"""Where a board drives by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from firmware_bridge.drivers.onboard.messages import Kind, floats, message, rows


@dataclass(frozen=True)
class Task:
    """Where the board drives by itself."""

    goal: tuple[float, ...]
    obstacles: tuple[tuple[float, ...], ...]
    path: tuple[tuple[float, ...], ...]

    def messages(self) -> bytes:
        """All of it: what is repeated changes nothing."""
        around = rows(Kind.OBSTACLES, self.obstacles) + rows(Kind.PATH, self.path)
        return around + message(Kind.GOAL, floats(self.goal))


def task_of(
    goal: Sequence[float],
    obstacles: Sequence[Sequence[float]],
    path: Sequence[Sequence[float]],
    circles: int,
    poses: int,
) -> Task:
    """Check a task for a board that holds so many circles and poses.

    Raises
    ------
    ValueError
        For numbers that are not finite, and for more than the board can hold.
    """
    (to,) = table_of("goal", [goal], 3, 1)
    around = table_of("obstacles", obstacles, 5, circles)
    return Task(to, around, table_of("path", path, 3, poses))


def table_of(
    name: str, values: Sequence[Sequence[float]], columns: int, most: int
) -> tuple[tuple[float, ...], ...]:
    """Check rows of finite numbers."""
    table = tuple(tuple(float(value) for value in row) for row in values)
    sound = all(len(row) == columns and all(map(math.isfinite, row)) for row in table)
    if len(table) > most or not sound:
        raise ValueError(
            f"{name}: expected at most {most} rows of {columns} finite numbers, got {len(table)}"
        )
    return table
