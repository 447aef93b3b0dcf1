"""A log as rows at the times of its poses: where the robot was, and what was asked of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.cutting import GAP, stretches
from kmpc_lite.learn.logs import Log
from kmpc_lite.types import Array

MOST_ROWS = 100_000
"""Most rows that are used; of a longer log, stretches spread over all of it."""
STRETCHES = 8
ROWS_PER_CHANGE = 8
"""Rows that are kept of the time in which commands change: windows need no more."""
FEWEST_ROWS = 500


@dataclass(frozen=True)
class Motion:
    """Rows of a log (n,), in whatever units and frame it came."""

    time: Array
    position: Array
    """x + i y, complex."""
    theta: Array
    asked: Array
    """Integrals of v and omega since the begin, (n, 2)."""
    whole: Array
    """Whether the step to the next row crosses no gap, (n - 1,) bool."""
    change: float
    """Rows in which the commands change: windows closer than this are not independent."""

    @property
    def period(self) -> float:
        """Median time between rows."""
        steps = np.diff(self.time)[self.whole]
        return float(np.median(steps)) if len(steps) else 0.0


def gather(log: Log) -> Motion | None:
    """Put a log into rows, or give None where too little of it has poses and commands."""
    time, poses = log.poses.time, log.poses.values
    inside = np.ones(len(time), dtype=bool) if log.together else stretches(log) >= 0
    if inside.sum() < 8:
        return None
    asked = _integrals(log, time)
    steps = np.diff(time)
    growing = steps[steps > 0.0]
    limit = GAP * float(np.median(growing)) if len(growing) else 0.0
    whole = (steps > 0.0) & (steps <= max(limit, 0.0)) & inside[:-1] & inside[1:]
    rows = _stretches(len(time))
    change = _change(np.diff(asked[rows], axis=0) * whole[rows[:-1], None])
    stride = max(1, min(int(change / ROWS_PER_CHANGE), len(rows) // FEWEST_ROWS))
    kept = rows[::stride]
    bad = np.concatenate([[0], np.cumsum(~whole)])
    unbroken = (bad[kept[1:]] == bad[kept[:-1]]) & (np.diff(kept) == stride)
    return Motion(
        time[kept],
        poses[kept, 0] + 1j * poses[kept, 1],
        poses[kept, 2],
        asked[kept],
        unbroken,
        max(1.0, change / stride),
    )


def _integrals(log: Log, time: Array) -> Array:
    """What the commands add up to by each time (n, 2), each held until the next.

    Rows of a table keep their order where its clock steps back, for their commands are their own.
    """
    if log.together:
        steps = np.maximum(np.diff(time), 0.0)[:, None]
        return np.vstack([np.zeros(2), np.cumsum(log.commands.values[:-1] * steps, axis=0)])
    order = np.argsort(log.commands.time, kind="stable")
    when, held = log.commands.time[order], log.commands.values[order]
    sums = np.vstack([np.zeros(2), np.cumsum(held[:-1] * np.diff(when)[:, None], axis=0)])
    at = np.clip(np.searchsorted(when, time, side="right") - 1, 0, len(when) - 1)
    late = np.maximum(time - when[at], 0.0)
    total: Array = sums[at] + held[at] * late[:, None]
    return total


def _stretches(count: int) -> Array:
    """Rows that are looked at."""
    if count <= MOST_ROWS:
        return np.arange(count)
    length = MOST_ROWS // STRETCHES
    starts = np.linspace(0, count - length, STRETCHES).astype(int)
    return np.concatenate([np.arange(s, s + length) for s in starts])


def _change(steps: Array) -> float:
    """Rows after which half of what the commands (n, 2) were is gone."""
    found = []
    for column in steps.T:
        size = float(column @ column)
        if size <= 0.0 or np.ptp(column) <= 1e-6 * np.abs(column).max():
            continue
        centred = column - column.mean()
        padded = np.fft.rfft(centred, 2 * len(centred))
        alike = np.fft.irfft(np.abs(padded) ** 2)[: len(centred) // 4 + 1]
        below = np.flatnonzero(alike < 0.5 * alike[0])
        found.append(float(below[0]) if len(below) else float(len(alike)))
    return min(found, default=1.0)
