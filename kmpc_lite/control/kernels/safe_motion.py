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
LEAVES = 0.5
"""A motion leaves a thing if its clearance grows by this share of what is driven."""


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
    brakes = (
        straight_brakes(first, step, length),
        brakes_along(first, inputs, step, length),
    )
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


def samples(states: Array, count: int) -> Array:
    """Poses (C, T count, 3) on the arcs between states (C, T + 1, 3), the first left out."""
    share = (np.arange(count) + 1.0) / count
    step = np.diff(states, axis=1)[:, :, None]
    poses = states[:, :-1, None] + share[:, None] * step
    bulge = 2.0 * (share * (1.0 - share)) * np.tan(0.25 * step[..., 2])
    poses[..., 0] += bulge * step[..., 1]
    poses[..., 1] -= bulge * step[..., 0]
    out: Array = poses.reshape(len(states), -1, 3)
    return out


def between_samples(
    clearance: Array, standing: Array, places: Array, begin: Array, radius: float
) -> Array:
    """Clearance (C, Q, E, K) at samples less what the chords between them may cut off [m].

    Past a point that the robot touches at a radius [m]. `standing` (1, Q, E, K) is the clearance at
    `begin` (E, 2), where the robot is now, `places` (C, Q, E, 2) are the samples. A chord that
    leads away begins at its nearest.
    """
    steps = np.diff(places, axis=1, prepend=np.broadcast_to(begin, (len(places), 1, *begin.shape)))
    squares = (steps * steps).sum(axis=-1)[..., None]
    lost = squares / (8.0 * radius)
    first = np.broadcast_to(standing[:, :1], (len(places), 1, *clearance.shape[2:]))
    before = np.concatenate([first, clearance[:, :-1]], axis=1)
    begins = np.where(clearance - before < lost, before - lost, np.inf)
    out: Array = np.minimum(clearance - lost, begins)
    return out


def surely_clear(
    clearance: Array, margins: Array, error: Array, travel: Array, ends: Array, lost: float
) -> Array:
    """Which motions keep more than `admissible` can ask of them, (C,).

    Parameters
    ----------
    clearance : ndarray
        (C, Q, E, K) at samples of the motions [m].
    margins : ndarray
        (C, Q) of what is driven and turned up to each sample [m].
    error, travel : ndarray
        (C,) the largest error of the coming commands, with what is not sure, and how far they lead
        [m].
    ends : ndarray
        (C,) samples until the robot is at rest.
    lost : float
        What chords between samples cut off at the most [m].
    """
    most = np.maximum(margins, (error + LEAVES * travel)[:, None]) + lost
    enough = clearance.min(axis=(2, 3)) >= most
    after = np.arange(clearance.shape[1]) >= ends[:, None]
    out: Array = np.logical_and.reduce(enough | after, axis=1)
    return out


def admissible(
    clearance: Array,
    standing: Array,
    spend: Array,
    margins: Array,
    driven: Array,
    error: Array,
    turns: Array,
    strict: Array,
    ends: Array,
    first: int,
    unsure: float,
) -> Array:
    """Which motions stay clear until they end, (C,).

    At every sample a robot keeps the margin of what it has driven and turned, or the clearance that
    it would have standing, less what it may spend. In the coming period, which no later step can
    mend, it also keeps the command's own error, beside what is not sure and what a standing robot
    would lack, unless the motion leads away; a thing that may turn towards the robot counts as an
    error of half of what is driven.

    Parameters
    ----------
    clearance : ndarray
        (C, Q, E, K) at samples of the motions [m].
    standing, spend : ndarray
        (1, Q, E, K) clearance of a robot that stands, and how much of it may be used up [m].
    margins : ndarray
        (C, Q) of what is driven and turned up to each sample [m].
    driven : ndarray
        (C, Q, E) from the begin on [m].
    error : ndarray
        (C, E, K) of the coming commands, towards each thing [m].
    turns : ndarray
        (K,) whether a thing may turn towards the robot.
    strict : ndarray
        (C,) whether a motion must keep its margins whatever a standing robot has.
    ends : ndarray
        (C,) samples until the robot is at rest.
    first : int
        Samples of the coming period.
    unsure : float
        What the pose's noise may pretend of a clearance [m].
    """
    left = standing - spend
    needed = np.minimum(margins[:, :, None, None], left)
    gain = clearance[:, :first] - standing[:, :first]
    half = LEAVES * driven[:, :first, :, None]
    own = error[:, None]
    kept = np.minimum(left[:, :first], unsure) + np.where(turns, np.maximum(half, own), own)
    leaves = (gain > 0.0) & (gain >= half)
    needed[:, :first] = np.where(leaves, left[:, :first], np.maximum(needed[:, :first], kept))
    needed = np.where(strict[:, None, None, None], margins[:, :, None, None], needed)
    # also false for NaN
    enough = np.logical_and.reduce(clearance >= needed - TINY, axis=(2, 3))
    after = np.arange(clearance.shape[1]) >= ends[:, None]
    out: Array = np.logical_and.reduce(enough | after, axis=1)
    return out
