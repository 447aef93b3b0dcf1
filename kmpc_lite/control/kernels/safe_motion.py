"""Safe motions: commands that end at rest, and which of them stay clear until then.

A motion is a coming command followed by a brake. Sizes: C motions, at most 32; T periods; S samples
a period, at most `MOST_SAMPLES`; E circles that make up the robot's outline, at most 5; K things,
at most 50.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kmpc_lite.types import Array

TINY = 1e-9
"""Sizes of commands, in periods of braking, and lengths [m] that count as none."""
TINY_STEP = 1e-4
"""Step of numerical differences, as a share of the robot's radius."""
SHARES = np.array((28, 24, 20, 16, 12, 8, 6, 4, 3, 2, 1)) / 32.0
"""Shares of the coming command's change that are tried if the whole one is not clear: eighths, and
finer ones of a robot that must be slow."""
TURN_SHARES = np.array((1.0, 0.25))
"""Shares of its turn that are tried after these, without driving."""
MOST_SAMPLES = 8
"""Most samples a period."""


def sizes(commands: Array, step: Array) -> Array:
    """Periods (...,) that braking takes from commands (..., 2) at a step (2,) a period."""
    out: Array = (np.abs(commands) / step).max(axis=-1)
    return out


def straight_brakes(first: Array, step: Array, length: int) -> Array:
    """Brakes (C, length, 2) after commands (C, 2): both speeds shrink by one factor to zero.

    The robot keeps to the curve that it is on. The last command is zero.
    """
    periods = np.maximum(sizes(first, step), TINY)[:, None]
    shares = np.maximum(1.0 - np.arange(1, length + 1) / periods, 0.0)
    shares[:, -1] = 0.0
    out: Array = shares[:, :, None] * first[:, None]
    return out


def brakes_along(first: Array, inputs: Array, step: Array, length: int) -> Array:
    """Brakes (C, length, 2) after commands (C, 2) along the path of a plan's inputs (N, 2).

    The plan is driven ever more slowly: its commands, as directions, over how far they lead.
    """
    size = sizes(inputs, step)
    drives = size > TINY
    if not drives.any():
        return straight_brakes(first, step, length)
    directions = inputs[drives] / size[drives, None]
    middles = (np.cumsum(size) - 0.5 * size)[drives]
    begins = sizes(first, step)[:, None]
    left = np.maximum(begins - np.arange(1, length + 1), 0.0)
    left[:, -1] = 0.0
    places = begins + np.cumsum(left, axis=1) - 0.5 * left
    turned = [np.interp(places, middles, column) for column in directions.T]
    out: Array = left[:, :, None] * np.stack(turned, axis=-1)
    return out


def slower_commands(whole: Array, hardest: Array) -> Array:
    """Coming commands (C, 2) instead of a whole one (2,), the largest first.

    Shares of its change from the hardest braking (2,), then turning alone, then that braking.
    """
    change = whole - hardest
    turn = np.zeros_like(change)
    turn[-1] = change[-1]
    shares = SHARES[:, None] * change, TURN_SHARES[:, None] * turn, np.zeros((1, len(change)))
    out: Array = hardest + np.concatenate(shares)
    return out


def both_brakes(first: Array, inputs: Array, step: Array, longest: int) -> Array:
    """Motions (2 C, T, 2): each of the commands (C, 2) with a straight brake, and along the plan.

    At most `longest` periods of braking.
    """
    periods = float(np.ceil(sizes(first, step).max() - TINY))
    length = int(np.clip(periods, 1, longest))
    brakes = (straight_brakes(first, step, length), brakes_along(first, inputs, step, length))
    both = np.stack(brakes, axis=1).reshape(2 * len(first), length, -1)
    out: Array = np.concatenate([first.repeat(2, axis=0)[:, None], both], axis=1)
    return out


def stacked(motions: Sequence[Array]) -> Array:
    """Motions (T, 2) of any lengths as one array (C, T, 2): zeros follow the shorter ones."""
    out = np.zeros((len(motions), max(map(len, motions)), motions[0].shape[1]))
    for row, motion in zip(out, motions, strict=True):
        row[: len(motion)] = motion
    return out


def lengths(motions: Array) -> Array:
    """After how many periods motions (C, T, 2) command zero for good, (C,)."""
    moves = np.logical_or.reduce(motions != 0.0, axis=2)
    periods = np.arange(1, motions.shape[1] + 1)
    out: Array = (moves * periods).max(axis=1)
    return out


def changes_allowed(commands: Array, faster: Array, slower: Array) -> Array:
    """Which motions (C, T, 2) change their commands by no more than is allowed, (C,).

    By `faster` (2,) a period away from zero, by `slower` (2,) towards it.
    """
    before, change = commands[:, :-1], np.diff(commands, axis=1)
    most = np.where(change * before < 0.0, slower, faster) * (1.0 + TINY) + TINY
    out: Array = np.logical_and.reduce(np.abs(change) <= most, axis=(1, 2))
    return out


def samples_a_period(longest: float, radius: float) -> int:
    """How many samples of a longest step [m] have chords that are short beside a radius [m]."""
    return min(max(math.ceil(longest / max(0.25 * radius, TINY)), 1), MOST_SAMPLES)
