"""Rows and pieces of driving, gathered over the episodes of a dataset."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.episode import Episode
from kmpc_lite.types import Array


class Transitions(NamedTuple):
    """Single steps, gathered over episodes."""

    x: Array
    """States before, (n, 3)."""
    u: Array
    """Commands, (n, 2)."""
    x_next: Array
    """States after, (n, 3)."""
    history: Array | None
    """Commands before `u`, oldest first, (n, L, 2); None for L = 0."""


class Pieces(NamedTuple):
    """Equally long pieces of driving, gathered over episodes."""

    states: Array
    """(n, steps + 1, 3)."""
    before: Array
    """Commands before each piece, oldest first, (n, history, 2)."""
    inputs: Array
    """Commands of each piece, (n, steps, 2)."""


def pieces_of(episode: Episode, starts: Array, steps: int, history: int) -> Pieces:
    """Pieces of one episode from its rows `starts` (n,) on."""
    rows = starts[:, None]
    return Pieces(
        episode.states[rows + np.arange(steps + 1)],
        episode.inputs[rows + np.arange(-history, 0)],
        episode.inputs[rows + np.arange(steps)],
    )


def joined(batch: list[Pieces]) -> Pieces:
    """Pieces one after another."""
    return Pieces(*map(np.concatenate, zip(*batch, strict=True)))
