"""Poses that are wrong, or lost."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from outcomes.plant import Array


class Jump:
    """The pose is wrong by this from one step until another."""

    def __init__(self, x: float, y: float, turn: float, first: int, after: int) -> None:
        self._off, self._steps = np.array([x, y, turn]), range(first, after)

    def __call__(self, k: int, pose: Array) -> Array:
        return pose + self._off if k in self._steps else pose


class Lost:
    """There is no pose from one step until another."""

    def __init__(self, first: int, after: int) -> None:
        self._steps = range(first, after)

    def __call__(self, k: int, pose: Array) -> Array:
        return np.full(3, np.nan) if k in self._steps else pose


class Frozen:
    """The pose stays as it was from one step until another."""

    def __init__(self, first: int, after: int) -> None:
        self._steps, self._pose = range(first, after), np.zeros(3)

    def __call__(self, k: int, pose: Array) -> Array:
        if k not in self._steps:
            self._pose = pose
        return self._pose


MEASURES: dict[str, Callable[[int, Array], Array]] = {
    "lost beside a jump": lambda k, p: Lost(13, 14)(k, Jump(1, 0.5, 0.3, 12, 30)(k, p)),
    "every third lost": lambda k, p: np.full(3, np.nan) if k % 3 == 2 else p,
    "whole turns": lambda k, p: p + (0, 0, 2 * math.pi * (k % 5 - 2)),
    "infinite once": lambda k, p: p + (0, np.inf if k == 9 else 0, 0),
}
