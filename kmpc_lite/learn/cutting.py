"""From a log to episodes: streams aligned by time, cut at gaps, put on an even grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.defaults import SHORTEST_PERIOD
from kmpc_lite.errors import DataError
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.episode import Episode, resample
from kmpc_lite.learn.logs import Log
from kmpc_lite.types import Array

JITTER = 0.1
"""Share of the period by which a time step may differ before the log counts as uneven."""
DRIFT = 0.01
"""Share of the median step by which the mean may differ before the log counts as uneven."""
GAP = 2.5
"""A time step longer than this many periods ends an episode."""
LONGEST_HOLD = 1.0
"""A command that is not repeated is taken to be held for this long, or for `GAP` of its stream's
periods, if that is longer [s]."""


NEAR = 7
"""Steps around each that tell how fast the robot drives there."""
SMOOTH = 21
"""Rows over which stamps of a busy recorder are averaged."""
FOLLOWED = 0.5
"""Share of the jitter of stamps that the motion follows if they tell when a pose was measured."""
SURE = 3.0
"""Standard errors by which that share must be less before stamps are doubted."""


def even_stamps(log: Log) -> Log:
    """Give poses the times at which they were measured, if a busy recorder stamped them later.

    Such a recorder stamps rows when it comes to write them. Steps of time jitter then, and the
    motion from row to row does not: it was measured evenly. If a row's step is long because it was
    measured late, the robot has moved farther in it, and the stamps stay.
    """
    time = log.poses.time
    steps = np.diff(time)
    if len(steps) < 2 * SMOOTH or not (steps >= 0.0).all():
        return log
    # a stall lets steps of many rows be short: their median is no period
    period = float(np.median(time[SMOOTH:] - time[:-SMOOTH])) / SMOOTH
    whole = ~_lasting_gaps(time, period)
    if whole.sum() < 2 * SMOOTH:
        return log
    jitter = float(np.std(steps[whole]))
    if jitter <= JITTER * period or _followed_share(log.poses.values, steps, whole) >= FOLLOWED:
        return log
    evened = [_evened(part) for part in np.split(time, np.flatnonzero(~whole) + 1)]
    poses = replace(log.poses, time=np.concatenate(evened))
    note = (
        f"steps between poses jitter by {1e3 * jitter:.0f} ms and the motion does not: the "
        "recorder was busy; times were made even"
    )
    commands = replace(log.commands, time=poses.time) if log.together else log.commands
    return replace(log, poses=poses, commands=commands, notes=(*log.notes, note))


def _lasting_gaps(time: Array, period: float) -> Array:
    """Which steps (n - 1,) are gaps that no burst of rows makes up for, as after a stall."""
    clock = time - period * np.arange(len(time))
    padded = np.pad(clock[1:], (0, SMOOTH - 1), constant_values=np.inf)
    least = np.lib.stride_tricks.sliding_window_view(padded, SMOOTH).min(axis=1)
    lasting: Array = (np.diff(time) > GAP * period) & (least - clock[:-1] > (GAP - 1.0) * period)
    return lasting


def _followed_share(poses: Array, steps: Array, whole: Array) -> float:
    """Share of the steps' jitter that the motion follows, and what it may be beyond chance."""

    def near(values: Array) -> Array:
        sums: Array = np.convolve(values, np.ones(NEAR), "valid")
        return sums

    inner = slice(NEAR // 2, len(steps) - NEAR // 2)
    unbroken = near(whole.astype(float)) > NEAR - 0.5
    usual = near(steps) / NEAR
    moves = np.hypot(*np.diff(poses[:, :2], axis=0).T), np.abs(wrap(np.diff(poses[:, 2])))
    jitters, answers = [], []
    for moved in moves:
        speed = near(moved) / np.maximum(near(steps), 1e-12)
        driven = unbroken & (speed > 0.3 * np.quantile(speed, 0.9)) & (speed > 0.0)
        jitters.append((steps[inner] - usual)[driven])
        answers.append(moved[inner][driven] / speed[driven] - usual[driven])
    jitter, answer = np.concatenate(jitters), np.concatenate(answers)
    size = float(jitter @ jitter)
    if size <= 0.0:
        return 1.0
    share = float(jitter @ answer) / size
    left = answer - share * jitter
    return share + SURE * float(np.sqrt(left @ left / len(left) / size))


def _evened(time: Array) -> Array:
    """Times (n,) of rows without a gap, on a clock that changes slowly."""
    if len(time) < SMOOTH:
        return time
    even = np.linspace(0.0, time[-1] - time[0], len(time))
    padded = np.pad(time - even, SMOOTH // 2, mode="edge")
    return even + np.convolve(padded, np.ones(SMOOTH) / SMOOTH, "valid")


def period_of(log: Log) -> float:
    """Median time between the poses of a log [s], however uneven it is."""
    time = log.poses.time
    steps = np.diff(time)
    growing = steps[steps > 0.0]
    if not len(growing):
        raise DataError(f"{log.name}: the time of its poses does not grow")
    return _tidy(float(np.median(growing)), 2.0 * float(np.spacing(np.abs(time).max())))


def model_period(log: Log) -> float:
    """Period of a model of a log if none is asked for [s]."""
    return max(SHORTEST_PERIOD, period_of(log))


def cut(log: Log, dt: float | None = None, gap: float | None = None) -> list[Episode]:
    """Make episodes of a log.

    Parameters
    ----------
    log : Log
        In SI units.
    dt : float, optional
        Period [s]. Without it a table must be evenly sampled and keeps its own; other logs get
        0.1 s, or that of their poses if it is longer.
    gap : float, optional
        A longer time between poses [s] ends an episode.

    Raises
    ------
    DataError
        If no episode is left.
    """
    if log.together:
        time, values = log.poses.time, np.column_stack([log.poses.values, log.commands.values])
        return _cut_table(log, np.column_stack([time, values]), dt, gap)
    return _cut_streams(log, dt, gap)


def _cut_table(log: Log, table: Array, dt: float | None, gap: float | None) -> list[Episode]:
    """Cut rows (n, 6) at the gaps, check that they are even, resample."""
    steps = np.diff(table[:, 0])
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    limit = GAP * period if gap is None else gap
    whole = (steps > 0.0) & (steps <= limit)
    if not whole.any():
        raise DataError(
            f"{log.name}: no two rows closer than {limit:g} s (the gap limit): nothing to learn "
            "from"
        )
    if dt is None:
        period = _even_period(log, table[:, 0], whole, period)
    parts = np.split(table, np.flatnonzero(~whole) + 1)
    episodes = [
        e
        for rows in parts
        if len(rows) >= 2 and (e := _episode(rows, period, dt, log.steered)) is not None
    ]
    if not episodes:
        raise DataError(
            f"{log.name}: no drive without a gap is as long as one period of {dt:g} s: "
            "nothing to learn from"
        )
    return episodes


def _even_period(log: Log, time: Array, whole: Array, median: float) -> float:
    """Give the period of an evenly sampled log [s]."""
    steps = np.diff(time)
    uneven = whole & (np.abs(steps - median) > JITTER * median)
    if uneven.any():
        row = int(np.argmax(uneven)) + 1
        raise DataError(
            f"{log.name}: {log.where(row)}, column t: "
            f"uneven sampling, a step of {steps[row - 1]:g} s where the median is {median:g} s; "
            "give dt= (--dt) to resample"
        )
    count, pieces = int(whole.sum()), 1 + int(np.sum(~whole))
    mean = float(steps[whole].mean())
    if abs(mean - median) > DRIFT * median:
        raise DataError(
            f"{log.name}: column t: "
            f"uneven sampling, steps of {mean:g} s in the mean but {median:g} s in the median; "
            "give dt= (--dt) to resample"
        )
    # the mean over a piece is known better than one step, by as many times as it has steps
    return _tidy(mean, 2.0 * float(np.spacing(np.abs(time).max())) * pieces / count)


def _tidy(period: float, resolution: float) -> float:
    """Round a period to what the time stamps can tell [s].

    With stamps that count from 1970 it is 0.05 s rather than 0.0499999523 s.
    """
    tolerance = max(1e-9 * period, resolution)
    candidates = (round(period, digits) for digits in range(16))
    return next((c for c in candidates if c > 0.0 and abs(c - period) <= tolerance), period)


def _episode(rows: Array, period: float, dt: float | None, steered: bool) -> Episode | None:
    """One episode from rows without a gap: as logged, or on an even grid of its own."""
    poses = unwrapped(rows[:, 1:4])
    if dt is None:
        return Episode(poses, rows[:-1, 4:], period, steered)
    return resample(rows[:, 0], poses, rows[:-1, 4:], dt, steered)


def unwrapped(poses: Array) -> Array:
    """Poses (n, 3) with headings that do not jump, the first within half a turn."""
    poses = poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    poses[:, 2] -= 2 * np.pi * np.round(poses[0, 2] / (2 * np.pi))
    return poses


def _cut_streams(log: Log, dt: float | None, gap: float | None) -> list[Episode]:
    """Episodes of poses and commands that came at times of their own."""
    period = period_of(log)
    dt = max(SHORTEST_PERIOD, period) if dt is None else dt
    limit = max(GAP * period, dt) if gap is None else gap
    order = np.argsort(log.commands.time, kind="stable")
    when, held = log.commands.time[order], log.commands.values[order]
    time, stretch = log.poses.time, stretches(log)
    steps = np.diff(time)
    broken = (steps <= 0.0) | (steps > limit) | (stretch[1:] != stretch[:-1])
    parts = np.split(np.arange(len(time)), np.flatnonzero(broken) + 1)
    episodes = [
        made
        for rows in parts
        if len(rows) >= 2 and stretch[rows[0]] >= 0
        if (made := _aligned(time[rows], log.poses.values[rows], (when, held), dt, log.steered))
        is not None
    ]
    if not episodes:
        raise DataError(
            f"{log.name}: {tell_overlap(log)}: no {dt:g} s without a gap in which poses and "
            "commands are both known"
        )
    return episodes


def stretches(log: Log) -> Array:
    """Number of the stretch of commands that holds at each pose (n,); -1 if none does."""
    times = np.sort(log.commands.time)
    steps = np.diff(times)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    hold = max(GAP * usual, LONGEST_HOLD)
    breaks = np.flatnonzero(steps > hold)
    begin = times[np.concatenate([[0], breaks + 1])]
    end = times[np.concatenate([breaks, [len(times) - 1]])] + hold
    at = np.searchsorted(begin, log.poses.time, side="right") - 1
    known = (at >= 0) & (log.poses.time <= end[np.maximum(at, 0)])
    numbers: Array = np.where(known, at, -1)
    return numbers


def tell_overlap(log: Log) -> str:
    """Say from when to when a log has poses, and commands."""
    (a, b), (c, d) = ((s.time.min(), s.time.max()) for s in (log.poses, log.commands))
    return f"poses from {a:.15g} to {b:.15g} s, commands from {c:.15g} to {d:.15g} s"


def _aligned(
    time: Array, poses: Array, commands: tuple[Array, Array], dt: float, steered: bool
) -> Episode | None:
    """One episode: poses (n, 3) at `time` interpolated, commands held from their times on."""
    when, held = commands
    first, last = np.searchsorted(when, (time[0], time[-1]), side="right")
    both = np.unique(np.concatenate([time, when[first:last]]))
    states = np.column_stack([np.interp(both, time, column) for column in unwrapped(poses).T])
    acting = np.searchsorted(when, both[:-1], side="right") - 1
    return resample(both, states, held[np.maximum(acting, 0)], dt, steered)
