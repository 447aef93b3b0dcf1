"""How late a robot answers, as weights of past commands: found, or of ages that are given.

A dead time and a time constant are smooth; free weights for every age are jagged, since commands in
a log change rarely, and lead a robot that trusts them sideways whenever its speed changes. Of ages
that are given the shares are found: none is negative, they add up to one, and they are the same
whichever way the motion shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.least_squares import nonnegative_least_squares
from kmpc_lite.learn.windows import Windows, block_moments
from kmpc_lite.types import Array

DEAD_TIMES = (0.0, 1.0, 2.0, 3.0, 5.0)
"""Dead times that are tried first [periods]."""
TIME_CONSTANTS = (0.0, 0.5, 1.0, 2.0, 3.5)
"""Time constants that are tried first [periods]."""
SETTLED = 3.0
"""Time constants after which a response counts as settled: 95 % of its final value."""


class Response(NamedTuple):
    """Answer of one motor: nothing for `dead_time`, then exponentially towards the command."""

    dead_time: float
    """[s]."""
    time_constant: float
    """[s]."""

    @property
    def delay(self) -> float:
        """Mean delay [s]: how far behind its commands the robot drives."""
        return self.dead_time + self.time_constant

    def described(self) -> list[float]:
        """Dead time and time constant [s]."""
        return list(self)

    def weights(self, dt: float, longest: int) -> tuple[float, ...]:
        """Weights of the present and at most `longest` past commands, newest first; of sum one.

        Each is the share of a command held for one period [s] that acts within a later period.
        """
        ages = min(longest, ceil((self.dead_time + SETTLED * self.time_constant) / dt - 1e-9))
        since = np.maximum(np.arange(ages + 2) * dt - self.dead_time, 0.0)
        travelled = since
        if self.time_constant > 0.0:
            travelled = since + self.time_constant * np.expm1(-since / self.time_constant)
        answered: Array = np.diff(np.diff(travelled) / dt, prepend=0.0)
        # what would act later than the longest history counts as acting with the oldest command
        answered[-1] += 1.0 - answered.sum()
        return tuple(float(k) for k in answered)


AT_ONCE = Response(0.0, 0.0)
"""A robot that obeys at once."""


def first_candidates(dt: float, longest: int) -> tuple[Response, ...]:
    """Responses that are tried first, `AT_ONCE` leading, within a history of `longest` periods."""
    pairs = [Response(d * dt, t * dt) for d in DEAD_TIMES for t in TIME_CONSTANTS]
    return tuple(r for r in pairs if _fits(r, dt, longest))


def neighbours(response: Response, step: float, dt: float, longest: int) -> tuple[Response, ...]:
    """Responses a step [s] away, within a history of `longest` periods."""
    ways = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1))
    dead, constant = response
    found = [Response(dead + i * step, constant + j * step) for i, j in ways]
    return tuple(r for r in found if min(r) >= 0.0 and _fits(r, dt, longest))


def _fits(response: Response, dt: float, longest: int) -> bool:
    """Whether a history of `longest` periods [s] holds most of a response."""
    dead, constant = response
    return dead <= longest * dt and dead + 2.0 * constant <= (longest + 1) * dt


ROUNDS = 20
"""Times that the shares of speed and turn rate are found in turns, each with the other's."""
RIDGE = 1e-9
"""Share of the largest eigenvalue that all others have at least."""


class AgedResponse(NamedTuple):
    """Answer of one motor, as shares of the present and of past commands."""

    shares: tuple[float, ...]
    """Newest first; of sum one."""
    delay: float
    """How far behind its commands the robot drives in the mean [s]."""

    @classmethod
    def of(cls, ages: Sequence[int], shares: Array, dt: float) -> AgedResponse:
        """Shares (L,) of commands of some ages, a period [s] long each."""
        whole = np.zeros(max(ages) + 1)
        whole[list(ages)] = shares
        return cls(tuple(whole.tolist()), dt * float(np.arange(len(whole)) @ whole))

    def weights(self, dt: float, longest: int) -> tuple[float, ...]:
        """Weights of the present and of past commands, newest first."""
        return self.shares

    def described(self) -> list[float]:
        """Dead time and time constant [s] that come as late in the mean."""
        return [self.delay, 0.0]


def shares_of_ages(windows: Windows, ages: Sequence[int]) -> tuple[AgedResponse, AgedResponse]:
    """How much of commands of some ages acts on the speed, and on the turn rate.

    Parameters
    ----------
    windows : Windows
        Of a log, after a history that holds the oldest.
    ages : sequence of int
        Different ones [periods].
    """
    count = len(ages)
    position, heading = _moments(windows, ages)
    speed = turn = np.full(count, 1.0 / count)
    zero, one = np.zeros((count, count)), np.eye(count)
    for _ in range(ROUNDS):
        before = np.concatenate([speed, turn])
        v, omega, none = speed[:, None], turn[:, None], np.zeros((count, 1))
        turn = _shares(heading, np.vstack([zero, one]), np.vstack([v, none]))
        omega = turn[:, None]
        # along: what turns add; across: what drives and turns add
        blocks = [[none, none, none], [omega, none, none], [none, v, none], [none, none, omega]]
        speed = _shares(position, np.vstack([one, zero, zero, zero]), np.block(blocks))
        if np.abs(np.concatenate([speed, turn]) - before).max() < RIDGE:
            break
    dt = windows.dt
    return AgedResponse.of(ages, speed, dt), AgedResponse.of(ages, turn, dt)


def _moments(windows: Windows, ages: Sequence[int]) -> tuple[Array, Array]:
    """Second moments of the commands by age and what came of them, the target last.

    Of the position: v and omega by age along, the same across, (4L + 1, 4L + 1); of the heading: v
    and omega by age, (2L + 1, 2L + 1).
    """
    count = len(ages)
    position, heading = np.zeros((4 * count + 1,) * 2), np.zeros((2 * count + 1,) * 2)
    for block in windows.blocks:
        by_age = np.stack([block.inputs[block.rows - age] for age in ages], axis=-1)
        w = by_age.reshape(len(block.rows), 2 * count)
        along, across, turned = block_moments(windows, block, w)
        position += along
        position += across
        heading += turned
    return position, heading


def _shares(moments: Array, taken: Array, beside: Array) -> Array:
    """Shares (L,) of least squares: none is negative, and their sum is one.

    Parameters
    ----------
    moments : ndarray
        (p + 1, p + 1), the target last.
    taken : ndarray
        (p, L) what each share weighs.
    beside : ndarray
        (p, m) what is free beside them.
    """
    count, basis = taken.shape[1], np.hstack([taken, beside])
    gram, aim = basis.T @ moments[:-1, :-1] @ basis, basis.T @ moments[:-1, -1]
    # what is free takes what it can
    solved = np.linalg.pinv(gram[count:, count:], rcond=RIDGE, hermitian=True) @ gram[count:]
    left = gram[:count, :count] - gram[:count, count:] @ solved[:, :count]
    aim = aim[:count] - solved[:, :count].T @ aim[count:]
    values, vectors = np.linalg.eigh(left)
    if not values[-1] > 0.0:
        return np.full(count, 1.0 / count)  # nothing tells
    root = np.sqrt(np.maximum(values, RIDGE * values[-1]))[:, None] * vectors.T
    # a robot whose motion has the other sign answers as late
    sign = math.copysign(1.0, aim.sum())
    found = nonnegative_least_squares(root, sign * aim)
    total = float(found.sum())
    return found / total if total > 0.0 else np.full(count, 1.0 / count)
