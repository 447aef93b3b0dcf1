"""Rows and pieces of driving, gathered over the episodes of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

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


Parts = TypeVar("Parts", Transitions, Pieces)


def pieces_of(episode: Episode, starts: Array, steps: int, history: int) -> Pieces:
    """Pieces of one episode from its rows `starts` (n,) on."""
    rows = starts[:, None]
    return Pieces(
        episode.states.take(rows + np.arange(steps + 1), axis=0),
        episode.inputs.take(rows + np.arange(-history, 0), axis=0),
        episode.inputs.take(rows + np.arange(steps), axis=0),
    )


def steps_of(episode: Episode, first: int, last: int, history: int) -> Transitions:
    """Steps of one episode from row `first` to before `last`: slices, which cost nothing."""
    rows, past = slice(first, last), None
    if history:
        before = np.arange(first, last)[:, None] + np.arange(-history, 0)
        past = episode.inputs.take(before, axis=0)
    after = episode.states[first + 1 : last + 1]
    return Transitions(episode.states[rows], episode.inputs[rows], after, past)


def joined(batch: list[Parts]) -> Parts:
    """Steps or pieces one after another."""
    columns: Iterable[Any] = (
        None if column[0] is None else np.concatenate(column) for column in zip(*batch, strict=True)
    )
    return type(batch[0])(*columns)


def gathered(parts: Iterable[Parts], chunk: int) -> Iterator[Parts]:
    """Join parts to chunks of about `chunk` rows."""
    batch: list[Parts] = []
    rows = 0
    for part in parts:
        batch.append(part)
        rows += len(part[0])
        if rows >= chunk:
            yield joined(batch)
            batch, rows = [], 0
    if batch:
        yield joined(batch)
