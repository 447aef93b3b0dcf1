"""From a log to episodes: streams aligned by time, cut at gaps, put on an even grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmpc_lite.defaults import SHORTEST_PERIOD
from kmpc_lite.errors import DataError
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.dataset import Episode, resample
from kmpc_lite.learn.logs import Log, speeds_of
from kmpc_lite.types import Array

JITTER, DRIFT = 0.1, 0.01
"""Share of the period by which a time step may differ, and of the median step by which the mean
may, before a log counts as uneven."""
GAP = 2.5  # a time step longer than this many periods ends an episode
JUMP = 10.0  # ratio of a step to the largest speed asked, and to nearly all other steps
USUAL = 0.95  # share of the steps that are nearly all
LONGEST_HOLD = 1.0
"""A command that is not repeated is taken to be held for this long, or for `GAP` of its stream's
periods, if that is longer [s]."""
NEAR, SMOOTH = 7, 21
"""Steps around each that tell how fast the robot drives there; rows over which stamps of a busy
recorder are averaged."""
FOLLOWED, SURE = 0.5, 3.0
"""Share of the jitter of stamps that the motion follows if they tell when a pose was measured;
standard errors by which it must be less before stamps are doubted."""


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
    # gaps that no burst of rows makes up for, as after a stall
    clock = time - period * np.arange(len(time))
    padded = np.pad(clock[1:], (0, SMOOTH - 1), constant_values=np.inf)
    least = np.lib.stride_tricks.sliding_window_view(padded, SMOOTH).min(axis=1)
    whole = (steps <= GAP * period) | (least - clock[:-1] <= (GAP - 1.0) * period)
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


def _followed_share(poses: Array, steps: Array, whole: Array) -> float:
    """Share of the steps' jitter that the motion follows, and what it may be beyond chance."""

    def near(values: Array) -> Array:
        sums: Array = np.convolve(values, np.ones(NEAR), "valid")
        return sums

    inner = slice(NEAR // 2, len(steps) - NEAR // 2)
    unbroken, usual = near(whole.astype(float)) > NEAR - 0.5, near(steps) / NEAR
    jitters, answers = [], []
    for moved in (np.hypot(*np.diff(poses[:, :2], axis=0).T), np.abs(wrap(np.diff(poses[:, 2])))):
        speed = near(moved) / np.maximum(near(steps), 1e-12)
        driven = unbroken & (speed > 0.3 * np.quantile(speed, 0.9)) & (speed > 0.0)
        jitters.append((steps[inner] - usual)[driven])
        answers.append(moved[inner][driven] / speed[driven] - usual[driven])
    jitter, answer = np.concatenate(jitters), np.concatenate(answers)
    if (size := float(jitter @ jitter)) <= 0.0:
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
    if not (steps > 0.0).any():
        raise DataError(f"{log.name}: the time of its poses does not grow")
    return _tidy(float(np.median(steps[steps > 0.0])), time)


def model_period(log: Log) -> float:
    """Period of a model of a log if none is asked for [s]."""
    return max(SHORTEST_PERIOD, period_of(log))


def _tidy(period: float, time: Array, pieces: float = 1.0) -> float:
    """Round a period [s] to what its time stamps can tell, in so many pieces of a step.

    With stamps that count from 1970 it is 0.05 s rather than 0.0499999523 s.
    """
    tolerance = max(1e-9 * period, 2.0 * pieces * float(np.spacing(np.abs(time).max())))
    candidates = (round(period, digits) for digits in range(16))
    return next((c for c in candidates if c > 0.0 and abs(c - period) <= tolerance), period)


def _even_period(log: Log, whole: Array) -> float:
    """Give the period of an evenly sampled log [s]; steps that are `whole` cross no gap."""
    steps = np.diff(log.poses.time)
    median, mean = float(np.median(steps[steps > 0.0])), float(steps[whole].mean())
    uneven = whole & (np.abs(steps - median) > JITTER * median)
    if uneven.any():
        row = int(np.argmax(uneven)) + 1
        told = f"a step of {steps[row - 1]:g} s where the median is {median:g} s"
        raise DataError(f"{log.name}: {log.where(row)}, column t: uneven sampling, {told}; "
                        "give dt= (--dt) to resample")  # fmt: skip
    if abs(mean - median) > DRIFT * median:
        told = f"steps of {mean:g} s in the mean but {median:g} s in the median"
        raise DataError(f"{log.name}: column t: uneven sampling, {told}; "
                        "give dt= (--dt) to resample")  # fmt: skip
    # the mean over a piece is known better than one step, by as many times as it has steps
    pieces = (1.0 + float((~whole).sum())) / float(whole.sum())
    return _tidy(mean, log.poses.time, pieces)


def cut(log: Log, dt: float | None = None, gap: float | None = None) -> list[Episode]:
    """Make episodes of a log.

    `log`: in SI units. `dt`: period [s]. Without it a table must be evenly sampled and keeps its
    own; other logs get 0.1 s, or that of their poses if it is longer. `gap`: a longer time between
    poses [s] ends an episode. Raises DataError if no episode is left.
    """
    time, (when, held) = log.poses.time, in_order(log, log.commands.values)
    steps, stretch = np.diff(time), stretches(log)
    growing = steps[steps > 0.0]
    period = float(np.median(growing)) if len(growing) else 0.0
    own = log.together and dt is None
    if dt is None and not own:
        dt = model_period(log)
    limit = gap or (GAP * period if log.together else max(GAP * period, dt or 0.0))
    whole = (steps > 0.0) & (steps <= limit) & (stretch[1:] == stretch[:-1])
    for jumped in jumps_of(log).values():  # the speed that is measured after one is the jump's
        whole &= (jumped == 0.0) & (np.append(0.0, jumped[:-1]) == 0.0)
    if own and whole.any():
        period = _even_period(log, whole)
    episodes = []
    for rows in np.split(np.arange(len(time)), np.flatnonzero(~whole) + 1):
        if len(rows) < 2 or stretch[rows[0]] < 0:
            continue
        poses, inputs = _unwrapped(log.poses.values[rows]), log.commands.values[rows[:-1]] \
            if log.together else held  # fmt: skip
        if own:
            episodes.append(Episode(poses, inputs, period, log.steered))
            continue
        at = time[rows]
        if not log.together:
            first, last = np.searchsorted(when, at[[0, -1]], side="right")
            both = np.unique(np.concatenate([at, when[first:last]]))
            poses = np.column_stack([np.interp(both, at, column) for column in poses.T])
            acting = np.searchsorted(when, both[:-1], side="right") - 1
            at, inputs = both, held[np.maximum(acting, 0)]
        made = resample(at, poses, inputs, dt or period, log.steered)
        episodes += [made] if made is not None else []
    if not episodes and log.together:
        what = f"no two rows closer than {limit:g} s (the gap limit)"
        if whole.any():
            what = f"no drive without a gap is as long as one period of {dt:g} s"
        raise DataError(f"{log.name}: {what}: nothing to learn from")
    if not episodes:
        spans = (f"{s.time.min():.15g} to {s.time.max():.15g} s" for s in (log.poses, log.commands))
        raise DataError(
            f"{log.name}: poses from {', commands from '.join(spans)}: no {dt:g} s without a gap "
            "in which poses and commands are both known"
        )
    return episodes


def asked_of(log: Log) -> Array:
    """Sizes of the commands that hold at each pose (n, 2)."""
    told = np.abs(speeds_of(log))
    if log.together:
        return told
    when, held = in_order(log, told)
    at = np.searchsorted(when, log.poses.time, side="right") - 1
    return held[np.maximum(at, 0)]


def jumps_of(log: Log) -> dict[str, Array]:
    """How far position [m] and heading [rad] jump in each step, (n - 1,); 0 where they do not.

    A jump is far larger than nearly all other steps between new poses, and than what was asked.
    """
    time, poses = log.poses.time, log.poses.values
    rows = np.flatnonzero(np.append(True, np.any(np.diff(poses, axis=0) != 0.0, axis=1)))
    if len(rows) < 20:  # too few to tell
        return {}
    told, steps, last = asked_of(log), np.diff(time[rows]), np.diff(time)[rows[1:] - 1]
    asked = np.minimum(told[1:], told[:-1]).max(axis=0)  # for longer than a jump
    moved, longest = np.diff(poses[rows], axis=0), GAP * np.median(steps)
    whole, seen = ((t > 0.0) & (t <= longest) for t in (steps, last))
    steps = np.minimum(steps, longest)  # it may have stood before
    found = {}
    for k, name in enumerate(("position", "heading")):
        size = np.abs(wrap(moved[:, 2])) if k else np.hypot(moved[:, 0], moved[:, 1])
        usual = float(np.quantile(size[whole], USUAL)) if whole.any() else np.inf
        jumps = seen & (size > JUMP * np.maximum(usual, float(asked[k]) * steps))
        if jumps.any():
            found[name] = np.zeros(len(time) - 1)
            found[name][rows[1:][jumps] - 1] = size[jumps]
    return found


def in_order(log: Log, commands: Array) -> tuple[Array, Array]:
    """Times of commands (n,) in order, and what was commanded then (n, m)."""
    order = np.argsort(log.commands.time, kind="stable")
    return log.commands.time[order], commands[order]


def _unwrapped(poses: Array) -> Array:
    """Poses (n, 3) with headings that do not jump, the first within half a turn."""
    turned = np.unwrap(poses[:, 2])
    turned -= 2 * np.pi * np.round(poses[0, 2] / (2 * np.pi))
    return np.column_stack([poses[:, :2], turned])


def stretches(log: Log) -> Array:
    """Number of the stretch of commands that holds at each pose (n,); -1 if none does."""
    if log.together:
        return np.zeros(len(log.poses.time), dtype=int)
    times, time = np.sort(log.commands.time), log.poses.time
    steps = np.diff(times)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    hold = max(GAP * usual, LONGEST_HOLD)
    breaks = np.flatnonzero(steps > hold)
    begin = times[np.concatenate([[0], breaks + 1])]
    end = times[np.concatenate([breaks, [len(times) - 1]])] + hold
    at = np.searchsorted(begin, time, side="right") - 1
    numbers: Array = np.where((at >= 0) & (time <= end[np.maximum(at, 0)]), at, -1)
    return numbers
