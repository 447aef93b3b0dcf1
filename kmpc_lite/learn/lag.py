"""How late a robot answers: one estimator of dead time and time constant for all wheels.

A motor answers nothing for a dead time, then goes exponentially towards its command. All dead times
and time constants up to `LONGEST` are compared, causal ones only, by how much of the motion over
short windows they leave with the gain that suits them; what is chosen has to explain more than none
does on parts of the log that it was not chosen by. Answers that fit alike are told: periodic
commands show a phase, which many answers have.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.model.dictionary.response import held_curvatures
from kmpc_lite.types import Array

SETTLED = 3.0  # time constants after which a response counts as settled: 95 % of its final value
LONGEST, KEPT = 1.0, 0.5
"""Longest dead time, and time constant, that is looked for [s]; share of the windows that must
remain after a history."""
TIME_CONSTANTS = (0.0, *(0.02 * 1.4 ** np.arange(12)))  # tried first [s]
CLOSEST = 0.025  # dead times that are tried at first lie half a period apart, or so far [s]
WITHIN = 0.8
"""Share of a history within which an answer must be over: else a longer one is looked at."""
WINDOW = 0.5  # length of the windows whose way is predicted [s]: longer than noise of poses matters
BLOCKS, FOLDS = 16, 8  # parts of the log that must agree, and those that are left out in turn
MOST_STEPS = 20_000  # steps of the log that are looked at
CHANCE = 0.05
"""Probability at which a lag or a ramp may be found that is none, for what is missed is a stop that
comes too late; and at which answers are left out of those that fit alike."""
TELLS_APART = 1.25
"""Ratio of time constants that fit alike from which on the answer is ambiguous, as with dead times
more than two periods apart; and of gains from which on those tell which answer is likelier."""


class Response(NamedTuple):
    """Answer of one motor: nothing for `dead_time`, then exponentially towards the command."""

    dead_time: float  # [s]
    time_constant: float  # [s]

    @property
    def delay(self) -> float:
        """Mean delay [s]: how far behind its commands the robot drives."""
        return self.dead_time + self.time_constant

    def periods(self, dt: float) -> int:
        """Age of the oldest command that acts, in periods [s]."""
        return ceil((self.dead_time + SETTLED * self.time_constant) / dt - 1e-9)

    def weights(self, dt: float, longest: int) -> tuple[float, ...]:
        """Weights of the present and at most `longest` past commands, newest first; of sum one.

        Each is the share of a command held for one period [s] that acts within a later period.
        """
        since = np.maximum(np.arange(min(longest, self.periods(dt)) + 2) * dt - self.dead_time, 0.0)
        travelled = since
        if self.time_constant > 0.0:
            travelled = since + self.time_constant * np.expm1(-since / self.time_constant)
        answered: Array = np.diff(np.diff(travelled) / dt, prepend=0.0)
        # what would act later than the longest history counts as acting with the oldest command
        answered[-1] += 1.0 - answered.sum()
        return tuple(float(k) for k in answered)


AT_ONCE = Response(0.0, 0.0)  # a robot that obeys at once


@dataclass(frozen=True)
class Found:
    """Response of motors, and what speaks for it."""

    response: Response  # the likeliest one
    sure: bool  # whether it explains more than none, beyond chance
    doubt: str = ""  # which others fit alike, in words


class Motor:
    """Numbers of a command that one motor, or several alike, obey; each with a gain of its own.

    `dataset`: evenly sampled episodes. `axes`: places of those numbers. `history`: time before each
    window that acts in it, as far as that leaves enough windows [s].
    """

    def __init__(self, dataset: Dataset, axes: Sequence[int], history: float = LONGEST) -> None:
        self.dt = dataset.dt
        before = np.cumsum([0, *(len(e) for e in dataset.episodes[:-1])])
        looked = [e for e, n in zip(dataset.episodes, before, strict=True) if n < MOST_STEPS]
        length, counts = max(1, round(WINDOW / self.dt)), np.array([len(e) for e in looked])
        self.longest = max(1, round(history / self.dt))
        """Periods of history before every window: as many as leave enough of them."""
        whole = np.maximum(counts - length + 1, 0).sum()
        while (
            self.longest and np.maximum(counts - self.longest - length + 1, 0).sum() < KEPT * whole
        ):
            self.longest -= 1
        used = [e for e in looked if len(e) >= self.longest + length] or looked[:1]
        counts = np.array([len(e) for e in used])
        ends = [np.arange(self.longest + length, n + 1, max(1, length // 2)) for n in counts]
        rows = np.concatenate([e + n for e, n in zip(ends, np.cumsum([0, *counts]), strict=False)])
        self._ends, self._begins = rows, rows - length
        self.blocks = min(BLOCKS, len(rows) // 8)
        self.parts = np.cumsum(counts)[:-1]  # rows at which episodes begin, but for the first
        self.told = [np.concatenate([_asked(e, axis) for e in used]) for axis in axes]
        """Commands (T,) of each number: speeds, or curvatures of a car."""
        self.moved = [np.concatenate([e.moved[:, axis] for e in used]) for axis in axes]
        """How far the robot went, or turned, in each period (T,)."""
        self._carried = [np.concatenate([_carried(e, axis) for e in used]) for axis in axes]

    def fit(
        self, responses: Sequence[Response], told: Sequence[Array] | None = None
    ) -> tuple[Array, Array]:
        """Errors of responses, each with the gains that suit it best.

        `responses`: what is compared. `told`: takes the place of the commands. Returns `errors`,
        `gains`: (R, B) shares of the squared motion that are left in each block, and (R,) mean
        gains.
        """
        errors, gains = np.zeros((len(responses), self.blocks)), np.zeros(len(responses))
        kernels = np.zeros((len(responses), self.longest + 1))
        for kernel, response in zip(kernels, responses, strict=True):
            weights = response.weights(self.dt, self.longest)
            kernel[: len(weights)] = weights
        first = np.linspace(0, len(self._ends), self.blocks, endpoint=False).astype(int)
        each = zip(told or self.told, self.moved, self._carried, strict=True)
        for asked, moved, carried in each:
            before = np.concatenate([np.zeros(self.longest), asked])
            late = sliding_window_view(before, len(asked))[::-1]  # by age
            seen, ways = self._windows(moved), kernels @ self._windows(carried * late)
            own = ways @ seen / np.maximum((ways**2).sum(axis=1), 1e-12)
            left = (seen - own[:, None] * ways) ** 2 / max(float(seen @ seen), 1e-12)
            errors += np.add.reduceat(left, first, axis=1)
            gains += own / len(self.told)
        return errors, gains

    def _windows(self, rows: Array) -> Array:
        """Sums (..., W) of rows (..., T) over whole windows, one every half of one."""
        sums = np.zeros((*rows.shape[:-1], rows.shape[-1] + 1))
        np.cumsum(rows, axis=-1, out=sums[..., 1:])
        out: Array = sums[..., self._ends] - sums[..., self._begins]
        return out

    def tried(self) -> list[Response]:
        """Responses that are compared first."""
        step = max(0.5 * self.dt, CLOSEST)
        dead = np.arange(0.0, min(LONGEST, self.longest * self.dt) + 1e-9, step)
        pairs = [Response(float(d), float(t)) for t in TIME_CONSTANTS for d in dead]
        return [r for r in pairs if r.delay <= self.longest * self.dt]


def _asked(episode: Episode, axis: int) -> Array:
    return held_curvatures(episode.inputs) if axis and episode.steered else episode.inputs[:, axis]


def _carried(episode: Episode, axis: int) -> Array:
    """What moves a robot by as much for each 1 of a command, (T,): the period, or a car's way."""
    if axis and episode.steered:
        return episode.moved[:, 0]
    return np.full(len(episode), episode.dt)


def find_response(dataset: Dataset, axes: Sequence[int]) -> Found:
    """Find dead time and time constant of the motor that some numbers of a command go to.

    For each time constant the dead time that suits it best is looked for to a fraction of a period;
    then those between the best ones. Histories become longer until the answer fits in. Where
    answers fit alike that need very different gains, the one of a robot that does what it is told
    counts: the gain nearest to one.
    """
    found = Found(AT_ONCE, False)
    for history in (LONGEST, 2.0 * LONGEST, (1.0 + SETTLED) * LONGEST):
        motor = Motor(dataset, axes, history)
        found = _find(motor)
        if found.response.periods(motor.dt) * motor.dt <= WITHIN * history:
            break
    return found


def _find(motor: Motor) -> Found:
    """Find the response by one length of history."""
    tried = motor.tried()
    if motor.blocks < BLOCKS // 2 or not tried:
        return Found(AT_ONCE, False)
    errors, _ = motor.fit(tried)
    sure = is_sure(errors[[tried.index(AT_ONCE)]], errors, CHANCE, relative=False)
    profile: dict[Response, Array] = {}
    for constant in dict.fromkeys(r.time_constant for r in tried):
        places = [k for k, r in enumerate(tried) if r.time_constant == constant]
        _add(profile, motor, constant, [tried[k].dead_time for k in places], errors[places])
    for ratio in (1.18, 1.09, 1.04):
        best = _best(profile)
        for constant in (best.time_constant * ratio, best.time_constant / ratio):
            near = best.delay - constant + np.arange(-2, 3) * CLOSEST / 2
            dead = sorted({max(0.0, float(d)) for d in near})
            if constant and dead[0] + constant <= motor.longest * motor.dt:
                around = [Response(d, constant) for d in dead]
                _add(profile, motor, constant, dead, motor.fit(around)[0])
    best = _best(profile)
    behind = {r: e - profile[best] for r, e in profile.items()}
    spread = {r: max(b.std(ddof=1) / np.sqrt(len(b)), 1e-15) for r, b in behind.items()}
    most = critical_score(motor.blocks, CHANCE)
    alike = [r for r in profile if behind[r].mean() <= most * spread[r]]
    dead, constants = ([r[k] for r in alike] for k in range(2))
    apart = max(dead) - min(dead) > 2.0 * motor.dt + 1e-9
    if not apart and max(constants) <= TELLS_APART**2 * max(min(constants), 0.25 * motor.dt):
        return Found(best, sure)
    _, gains = motor.fit(alike)
    sizes = np.abs(np.log(np.maximum(gains, 1e-3)))
    if np.ptp(sizes) > np.log(TELLS_APART):
        best = alike[int(np.argmin(sizes))]
    return Found(
        best,
        sure,
        f"dead times of {min(dead):.2f} to {max(dead):.2f} s with time constants of "
        f"{max(constants):.2f} to {min(constants):.2f} s fit alike",
    )


def _add(
    profile: dict[Response, Array],
    motor: Motor,
    constant: float,
    dead: Sequence[float],
    errors: Array,
) -> None:
    """Add the best dead time for a time constant, between those tried (D,), with its errors."""
    total = errors.sum(axis=1)
    k = int(total.argmin())
    profile[Response(dead[k], constant)] = errors[k]
    if 0 < k < len(dead) - 1:  # a parabola through the best three
        bend, slope, _ = np.polyfit(dead[k - 1 : k + 2], total[k - 1 : k + 2], 2)
        if bend > 0.0:
            between = float(np.clip(-0.5 * slope / bend, dead[k - 1], dead[k + 1]))
            profile[Response(between, constant)] = motor.fit([Response(between, constant)])[0][0]


def _best(profile: dict[Response, Array]) -> Response:
    """The response that leaves least."""
    return min(profile, key=lambda r: float(profile[r].sum()))


def mean_delay(dataset: Dataset, axes: Iterable[int] | None = None, sure: bool = True) -> float:
    """Mean delay of motion behind its commands [s]; zero if none is sure, where that is asked.

    `dataset`: evenly sampled episodes. `axes`: which numbers of a command are looked at; all if not
    given. `sure`: whether a delay must explain more than none, beyond chance.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> mean_delay(generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0))
    0.0
    """
    found = find_response(dataset, list(axes or range(dataset.commands)))
    return found.response.delay if found.sure or not sure else 0.0


def aligned(dataset: Dataset, delay: float) -> Dataset:
    """Give the same driving with each command where it acts, a delay [s] later."""
    whole, part = divmod(delay / dataset.dt, 1.0)
    first = int(whole) + 1
    episodes = []
    for episode in dataset.episodes:
        if len(episode) > first:
            rows = np.arange(first, len(episode))
            newer, older = episode.inputs[rows - first + 1], episode.inputs[rows - first]
            late = newer + part * (older - newer)
            episodes.append(replace(episode, states=episode.states[first:], inputs=late))
    return Dataset(episodes)


def is_sure(
    free: Array, tried: Array, chance: float, worth: float = 0.0, relative: bool = True
) -> bool:
    """Whether one of several explanations (C, B) errs less than the best of others (R, B).

    Beyond chance, and by a share of the error. What is compared on a part of the log was chosen on
    the other parts.
    """
    blocks = free.shape[1]
    folds, honest = assign_folds(blocks), np.empty((2, blocks))
    for kind, errors in enumerate((free, tried)):
        for fold in range(int(folds.max()) + 1):
            out = folds == fold
            honest[kind, out] = errors[int(errors[:, ~out].sum(axis=1).argmin())][out]
    reference, left = honest
    if left.sum() > (1.0 - worth) * reference.sum():
        return False
    return gain_score(reference, left, relative) > critical_score(blocks, chance)


def assign_folds(blocks: int) -> Array:
    """Fold of each block, (B,): contiguous, for what changes slowly."""
    return np.arange(blocks) * min(FOLDS, blocks) // max(blocks, 1)


def gain_score(reference: Array, errors: Array, relative: bool = True) -> float:
    """Mean over the blocks of the relative gain, in standard errors; never positive without a gain.

    Relative, ``(reference - errors) / (reference + errors)``, for a block in which the robot drives
    fast must not drown those in which it drives slowly.
    """
    total = reference + errors
    gains = reference - errors
    if relative:
        gains = gains / np.where(total > 0.0, total, 1.0)
    mean = float(gains.mean())
    if reference.sum() <= errors.sum():
        mean = min(mean, 0.0)
    spread = float(gains.std(ddof=1)) / np.sqrt(len(gains))
    if spread <= 0.0:
        return float(np.sign(mean) * np.inf) if mean else 0.0
    return float(mean / spread)


def critical_score(blocks: int, significance: float) -> float:
    """Score that a worthless candidate exceeds with a probability of at most `significance`."""
    from scipy.special import stdtrit  # here, for it takes time to import

    return float(stdtrit(blocks - 1, 1.0 - significance))
