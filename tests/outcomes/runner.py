"""Rows side by side on worker processes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from outcomes.loop import Result, drive_row, result_of
from outcomes.plant import Array
from outcomes.rows import ROWS
from outcomes.setup import Row

CHUNK, CHUNKS = 4, 12
"""Tasks that a worker takes at once, and after how many of those it is replaced: its memory, with
the models that it has learned, stays flat."""
Key = tuple[str, int, int]  # name of a row, seed, and number of the perturbation (0: none)


@dataclass
class Driven:
    """What a worker gives back."""

    key: Key
    result: Result | None  # none if the row's data is missing
    commands: Array  # (T, 2)


def drive_key(key: Key) -> Driven:
    """Drive a row with a seed and a perturbation."""
    name, seed, perturbed = key
    row = ROWS[name]
    trace = drive_row(row, seed, perturbed)
    if trace is None:
        return Driven(key, None, np.empty((0, 2)))
    commands = np.array(trace.commands, dtype=float).reshape(len(trace.commands), -1)
    return Driven(key, result_of(row, trace), commands)


def drive_all(keys: Sequence[Key], jobs: int = 2) -> Iterator[Driven]:
    """Drive all, in the order of the keys."""
    if jobs <= 1:
        yield from map(drive_key, keys)
        return
    with get_context("spawn").Pool(jobs, maxtasksperchild=CHUNKS) as pool:
        yield from pool.imap(drive_key, keys, CHUNK)


def chosen(pattern: str = "", quick: bool = False) -> list[Row]:
    """Rows whose family or name a pattern is found in; all of them where it is empty."""
    found = [
        row
        for row in ROWS.values()
        if re.search(pattern, f"{row.family}: {row.name}", re.IGNORECASE)
    ]
    return [row for row in found if row.quick] if quick else found
