"""A log at the times of its poses: where the robot was, what was asked of it, what is odd in it.

Jumps and stand-stills of the poses are reported though the log is learned from. A pose that is
repeated to the last digit while the robot is commanded to move is no new one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.geometry import wrap
from kmpc_lite.learn.cutting import GAP, stretches
from kmpc_lite.learn.logs import Log
from kmpc_lite.types import INPUTS, Array

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
    """Integrals of v and omega since the begin, (n, 2); complex of an omni: ahead + i left."""
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
    """Put a log into rows, or give None if too little of it has poses and commands."""
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
    told = _speeds(log)
    if log.together:
        steps = np.maximum(np.diff(time), 0.0)[:, None]
        return np.vstack([np.zeros(2), np.cumsum(told[:-1] * steps, axis=0)])
    order = np.argsort(log.commands.time, kind="stable")
    when, held = log.commands.time[order], told[order]
    sums = np.vstack([np.zeros(2), np.cumsum(held[:-1] * np.diff(when)[:, None], axis=0)])
    at = np.clip(np.searchsorted(when, time, side="right") - 1, 0, len(when) - 1)
    late = np.maximum(time - when[at], 0.0)
    total: Array = sums[at] + held[at] * late[:, None]
    return total


def _speeds(log: Log) -> Array:
    """Commands v and omega (n, 2); an omni's v is complex, ahead + i left."""
    told = log.commands.values
    if told.shape[1] == INPUTS:
        return told
    return np.column_stack([told[:, 0] + 1j * told[:, 1], told[:, 2]])


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
        centred = column - column.mean()
        if not np.abs(centred).max(initial=0.0) > 1e-6 * np.abs(column).max(initial=0.0):
            continue
        padded = np.fft.fft(centred, 2 * len(centred))
        alike = np.fft.ifft(np.abs(padded) ** 2).real[: len(centred) // 4 + 1]
        below = np.flatnonzero(alike < 0.5 * alike[0])
        found.append(float(below[0]) if len(below) else float(len(alike)))
    return min(found, default=1.0)


# thresholds above which a line is written
JUMP = 10.0
"""Ratio of a step to the largest speed asked, and to nearly all other steps."""
USUAL = 0.95
"""Share of the steps that are nearly all."""
STANDING = 0.1
"""Share of the largest command below which a robot may stand."""
LATE = 1.5
"""Periods of a model that may pass between two new poses of a moving robot."""
LOST = 3.0
"""Time for which a robot is commanded to move while its pose stands still [s]."""


def tell_poses(log: Log, dt: float) -> list[str]:
    """What is remarkable in the poses, one line each.

    Parameters
    ----------
    log : Log
        In SI units.
    dt : float
        The model's period [s].
    """
    time, poses = log.poses.time, log.poses.values
    new = np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])
    rows = np.flatnonzero(new)
    if len(rows) < 20:
        return []
    asked = _asked(log, time)
    told = _tell_repeats(log, dt, rows, asked)
    steps = np.diff(poses[rows], axis=0)
    sizes = {"position": np.hypot(steps[:, 0], steps[:, 1]), "heading": np.abs(wrap(steps[:, 2]))}
    for k, (name, size) in enumerate(sizes.items()):
        unit = ("m", "rad")[k]
        told += _tell_jumps(log, rows, size, float(asked[:, k].max()), (name, unit))
    return told


def _asked(log: Log, time: Array) -> Array:
    """Sizes of the commands that hold at each pose (n, 2)."""
    told = np.abs(_speeds(log))
    if log.together:
        return told
    order = np.argsort(log.commands.time, kind="stable")
    at = np.searchsorted(log.commands.time[order], time, side="right") - 1
    return told[order][np.maximum(at, 0)]


def _tell_repeats(log: Log, dt: float, rows: Array, asked: Array) -> list[str]:
    """Lines on poses that come seldom, or not at all for a while, though the robot should move."""
    time = log.poses.time
    moving = np.any(asked > STANDING * asked.max(axis=0), axis=1)
    still = np.concatenate([[0], np.cumsum(~moving)])
    steps = np.diff(time[rows])
    driven = (still[rows[1:]] == still[rows[:-1]]) & (steps > 0.0)
    if driven.sum() < 20:
        return []
    every = float(np.median(steps[driven]))
    period = float(np.median(np.diff(time)))
    if np.diff(rows)[driven].max() > 1 and every > LATE * dt:
        return [
            f"poses of the moving robot change every {every:.2g} s only, though logged every "
            f"{period:.2g} s: what lies between is old, and learned as lateness; --dt {every:.2g}"
        ]
    held = np.clip(np.diff(time), 0.0, GAP * period) * moving[:-1]
    told = np.diff(np.concatenate([[0.0], np.cumsum(held)])[rows])
    lost = (np.diff(rows) > 1) & (told > LOST)
    if not lost.any():
        return []
    longest = int(np.argmax(told * lost))
    return [
        f"{log.where(int(rows[longest]))}: the pose does not change for {steps[longest]:.3g} s, in "
        f"which the robot is commanded to move ({int(lost.sum())} such): blocked, or its pose was "
        "lost; cut that out"
    ]


def _tell_jumps(
    log: Log,
    rows: Array,
    size: Array,
    asked: float,
    named: tuple[str, str],
) -> list[str]:
    """A line on steps between new poses that are far larger than all others and than asked."""
    steps = np.diff(log.poses.time[rows])
    period = float(np.median(steps))
    whole = (steps > 0.0) & (steps <= GAP * period)
    if not whole.any():
        return []
    usual = float(np.quantile(size[whole], USUAL))
    jumps = whole & (size > JUMP * np.maximum(usual, asked * steps))
    if not jumps.any():
        return []
    k = int(np.argmax(np.where(jumps, size, 0.0)))
    name, unit = named
    return [
        f"{log.where(int(rows[k + 1]))}: the {name} jumps by {size[k]:.3g} {unit} in "
        f"{steps[k]:.2g} s ({int(jumps.sum())} such jumps), where {asked:.2g} {unit}/s is the most "
        "that is asked: outliers or a frame that was moved widen the margins; cut them out"
    ]
