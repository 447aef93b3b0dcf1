"""How well commands explain a log's motion: at every causal delay, over windows of all lengths.

A wheeled robot moves along its heading and turns as it is commanded, some time later. So steps of
its position, turned into the robot's frame, follow v, and steps of its heading omega.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.geometry import wrap
from kmpc_lite.learn.cutting import GAP, in_order, jumps_of, stretches
from kmpc_lite.learn.logs import Log, speeds_of
from kmpc_lite.types import Array

MOST_ROWS, STRETCHES = 20_000, 8
"""Most rows that are looked at; of a longer log, stretches spread over all of it."""
LENGTHS, SHARP = (1, 2, 4, 8, 16, 32, 64, 128), 4
"""Rows of a window: short ones show delays, long ones what noise hides. Windows up to SHARP tell
when; so many rows round what longer ones found."""
LATEST, EARLY = 4.0, 3.0
"""How late a motion is looked for behind its command, and how far before it [s]."""
FEWEST_WINDOWS, CHANCE = 12.0, 1e-5
"""Windows that do not overlap and are needed; probability that chance explains as much."""
LEAST_SHARE, LITTLE, GOOD = 0.1, 0.4, 0.3
"""Share of a motion that has to be explained; below which it counts as not explained if chance
could explain as much; that the better of two readings has to explain."""
TIMES, BETTER = 4.0, 0.6
"""A reading is wrong if it leaves so many times as much unexplained as another one, and explains
less than such a share of what that explains."""
ALIKE, DIP = 0.1, 0.2
"""Delays are alike if they differ by so little of how much less is explained between them, which
is at least that much."""
DEGREES = np.pi / 180.0


@dataclass(frozen=True)
class Motion:
    """A log in even rows (n,), in whatever units and frame it came."""

    period: float  # between two rows
    steps: Array  # of the position from row to row, complex (n - 1,)
    theta: Array  # heading as it came (n,)
    asked: Array
    """What the commands add up to in each step, (n - 1, 2); complex of an omni: ahead + i left."""
    whole: Array  # whether a step crosses no gap, (n - 1,) bool
    change: float  # rows in which the commands change: windows closer than this are not independent

    def turned(self, sign: int, scale: float) -> tuple[Array, Array]:
        """Steps seen from the robot, complex, and turns, under one reading of theta."""
        theta = sign * scale * self.theta
        turns = wrap(np.diff(theta))
        facing = np.exp(-1j * (theta[:-1] + 0.5 * turns))
        return np.where(self.whole, self.steps * facing, 0.0), np.where(self.whole, turns, 0.0)


class Match(NamedTuple):
    """How well commands explain a motion, at the best delay and length of windows."""

    share: float = 0.0  # of the motion's energy: 1 is all of it
    chance: float = 1.0  # share that chance could explain
    factor: complex = 0.0  # motion for each unit that was asked
    lag: float = 0.0  # rows by which the motion is later
    length: int = 1  # rows of a window
    reverse: float = 0.0  # share that the opposite sign explains at its best delay
    early: float = 0.0  # share at the best delay before the command ...
    early_lag: float = 0.0  # ... which is this many rows, below 0.
    rival: float | None = None
    """Another delay that explains as much [rows]: the commands are periodic."""

    @property
    def sure(self) -> bool:
        """Whether it explains more than chance could."""
        return self.share > max(LEAST_SHARE, self.chance)

    @property
    def absent(self) -> bool:
        """Whether there is enough of a log to say that it does not explain the motion."""
        return self.chance < 1.0 and not self.sure and self.share < LITTLE

    def loses_to(self, share: float) -> bool:
        """Whether a reading that explains `share` is surely the better one."""
        better = 1.0 - self.share > TIMES * (1.0 - share) and self.share < BETTER * share
        return better and share > max(GOOD, self.chance)


def gather(log: Log) -> Motion | None:
    """Put a log into even rows, or give None if too little of it has poses and commands."""
    time, poses = log.poses.time, log.poses.values
    inside, steps = stretches(log) >= 0, np.diff(time)
    growing = steps[steps > 0.0]
    if inside.sum() < 8 or not len(growing):
        return None
    period = float(np.median(growing))
    whole = (steps > 0.0) & (steps <= GAP * period) & inside[:-1] & inside[1:]
    for jumped in jumps_of(log).values():
        whole &= jumped == 0.0
    # gaps take one period, so that rows stay as many as there were
    clock = np.concatenate([[0.0], np.cumsum(np.where(whole, steps, period))])
    sums = np.vstack([np.zeros(2), np.cumsum(_asked(log, time) * whole[:, None], axis=0)])
    path = np.concatenate([[0.0], np.cumsum(np.diff(poses[:, 0] + 1j * poses[:, 1]) * whole)])
    grid = period * np.arange(int(clock[-1] / period) + 1)
    last = np.clip(np.searchsorted(clock, grid, side="right") - 1, 0, len(whole) - 1)
    rows = np.arange(len(grid) - 1)
    if len(rows) > MOST_ROWS:
        length = MOST_ROWS // STRETCHES
        starts = np.linspace(0, len(rows) - length, STRETCHES).astype(int)
        rows = (starts[:, None] + np.arange(length)).ravel()
    asked = np.diff(np.column_stack([np.interp(grid, clock, c) for c in sums.T]), axis=0)[rows]
    good = whole[last][rows] & whole[last[1:]][rows]
    theta = poses[last, 2][np.append(rows, rows[-1] + 1)]
    moved = np.diff(np.interp(grid, clock, path))[rows]
    return Motion(period, moved, theta, asked, good, _change(asked * good[:, None]))


def _asked(log: Log, time: Array) -> Array:
    """What the commands add up to between two poses (n - 1, 2), each held until the next."""
    told = speeds_of(log)
    if log.together:
        return told[:-1] * np.maximum(np.diff(time), 0.0)[:, None]
    when, held = in_order(log, told)
    sums = np.vstack([np.zeros(2), np.cumsum(held[:-1] * np.diff(when)[:, None], axis=0)])
    at = np.clip(np.searchsorted(when, time, side="right") - 1, 0, len(when) - 1)
    return np.diff(sums[at] + held[at] * np.maximum(time - when[at], 0.0)[:, None], axis=0)


def _change(steps: Array) -> float:
    """Rows after which half of what the commands (n, 2) were is gone."""
    found = [np.inf]
    for column in steps.T:
        centred = column - column.mean()
        if not np.abs(centred).max(initial=0.0) > 1e-6 * np.abs(column).max(initial=0.0):
            continue
        padded = np.fft.fft(centred, 2 * len(centred))
        alike = np.fft.ifft(np.abs(padded) ** 2).real[: len(centred) // 4 + 1]
        below = np.flatnonzero(alike < 0.5 * alike[0])
        found.append(float(below[0]) if len(below) else float(len(alike)))
    return max(1.0, min(found)) if len(found) > 1 else 1.0


def match(motion: Motion, moved: Array, asked: Array) -> Match:
    """Explain steps `moved` (n,) by steps `asked` (n,): the best causal delay and windows."""
    asked, count = np.where(motion.whole, asked, 0.0), len(asked)
    early, late = (min(int(most / motion.period), count // 4) for most in (EARLY, LATEST))
    lags = np.arange(-early, late + 1)
    size = 2 ** int(np.ceil(np.log2(2 * count)))
    best, beyond, sharp = Match(), -np.inf, np.zeros(len(lags))
    for length in LENGTHS:
        windows = motion.whole.sum() / max(length, motion.change)
        if windows < FEWEST_WINDOWS or count <= length:
            continue
        x, y = (moving_sum(column, length) for column in (asked, moved))
        xx, yy = (float(np.vdot(column, column).real) for column in (x, y))
        if xx <= 0.0 or yy <= 0.0:
            continue
        products = np.fft.ifft(np.fft.fft(y, size) * np.fft.fft(x, size).conj())[lags]
        # as if the factor were known: one degree of freedom is the factor's
        shares = 1.0 - (1.0 - np.abs(products) ** 2 / (xx * yy)) * windows / (windows - 1.0)
        chance = 1.0 - CHANCE ** (1.0 / (windows - 1.0))
        sharp = shares if length <= SHARP else sharp
        found = _best(lags, shares, products / xx)._replace(chance=chance, length=length)
        if (gain := (found.share - chance) / max(1.0 - chance, 1e-12)) > beyond:
            best, beyond = found, gain
    if best.length > SHARP:  # long windows tell whether, short ones when
        lag, early_lag = (_nearby(lags, sharp, found) for found in (best.lag, best.early_lag))
        best = best._replace(lag=lag, early_lag=early_lag)
    return best


def _nearby(lags: Array, shares: Array, lag: float) -> float:
    """Lag of the best share near to another."""
    near = np.flatnonzero((np.abs(lags - lag) <= SHARP) & ((lags >= 0) == (lag >= 0)))
    return _refined(lags, shares, int(near[np.argmax(shares[near])]))


def moving_sum(steps: Array, length: int) -> Array:
    """Sums over so many steps in a row, (n - length + 1,)."""
    sums = np.concatenate([[0.0], np.cumsum(steps)])
    total: Array = sums[length:] - sums[:-length]
    return total


def _best(lags: Array, shares: Array, factors: Array) -> Match:
    """Choose among delays; a delay before the command only counts for `early`."""
    causal = np.flatnonzero(lags >= 0)
    top = causal[int(np.argmax(shares[causal]))]
    same = np.real(factors * np.conj(factors[top])) > 0.0
    before = shares[: causal[0]]
    ahead = int(np.argmax(before)) if len(before) else 0
    return Match(
        float(shares[top]),
        factor=complex(factors[top]),
        lag=_refined(lags, shares, top),
        reverse=float(np.max(shares[causal], initial=0.0, where=~same[causal])),
        early=float(before[ahead]) if len(before) else 0.0,
        early_lag=_refined(lags, shares, ahead),
        rival=_rival(lags, np.where(same, shares, 0.0), top, causal),
    )


def _refined(lags: Array, shares: Array, top: int) -> float:
    """Lag of the best share to a part of a row: the top of a parabola."""
    aside = 0.0
    if 0 < top < len(lags) - 1:
        before, here, after = shares[top - 1 : top + 2]
        curve = before - 2.0 * here + after
        aside = 0.5 * (before - after) / curve if curve < 0.0 else 0.0
    return float(lags[top] + aside) if abs(aside) <= 1.0 else float(lags[top])


def _rival(lags: Array, shares: Array, top: int, causal: Array) -> float | None:
    """Another delay that explains as much, with less between them; None if there is none."""
    for part in (causal[causal > top], causal[causal < top][::-1]):
        less = shares[top] - shares[part]
        deepest = np.maximum.accumulate(less)
        alike = (less < ALIKE * deepest) & (deepest > DIP)
        if alike.any():
            return float(lags[part[int(np.argmax(alike))]])
    return None
