"""Commands of ages that are given: how much of each acts, as the log shows it.

What a motor does with a command is spread over its age: no share is negative, all of them add up
to one, and they are the same whichever way the motion shows it. Free weights for every age and
direction are jagged whatever the window, for commands in a log change rarely, and lead a robot that
trusts them sideways whenever its speed changes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.least_squares import nonnegative_least_squares
from kmpc_lite.learn.windows import Windows, block_moments
from kmpc_lite.types import Array

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
