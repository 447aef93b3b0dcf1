"""Windows of about a second: what the symmetric fit regresses, summed over blocks of a log.

Over a window the robot moves by ``d = sum_j dt mean(exp(i theta))_j (a + i b) w_j`` and turns by
``sum_j dt g w_j``: linear in the rows a (along), b (across) and g (heading) whatever the window's
length, with measured headings. In long windows the pose's noise weighs less, and lags show that one
step hides. A log is cut into blocks; no window crosses a block's end, and every candidate is judged
on the same windows: those that the longest history leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.model.dictionary.response import evaluate_terms, held_curvatures, terms_of
from kmpc_lite.types import INPUTS, Array

MOST_BLOCKS = 64  # blocks that a log is cut into at most


class Rows(NamedTuple):
    """Response of the robot to each of its terms: the three rows of a symmetric generator."""

    along: Array  # forward speed by each term, (T,)
    across: Array  # speed to the left, (T,)
    heading: Array  # turn rate, (T,)


def nominal_rows(commands: int = INPUTS) -> Rows:
    """Rows of the robot that obeys its commands exactly."""
    rows = np.zeros((3, len(terms_of(commands))))
    rows[0, 0] = rows[2, commands - 1] = 1.0
    if commands > INPUTS:
        rows[1, 1] = 1.0
    return Rows(*rows)


@dataclass(frozen=True)
class Block:
    """Stretches of a log, with the commands before each, one after another."""

    inputs: Array  # commands, those before each stretch included, (R, m)
    rows: Array  # row of `inputs` of each period, (T,)
    turned: Array  # mean of exp(i theta) over each period, times dt, (T,) complex
    starts: Array  # first period of each window, (S,)
    frame: Array  # rotates a window's displacement into its middle heading, (S,) complex
    moved: Array  # displacement over each window in that frame, along + i across [m], (S,) complex
    heading: Array  # turn over each window [rad], (S,)
    curvatures: Array | None = None  # of a car's commands, in the rows of `inputs`, (R,) [1/m]


@dataclass(frozen=True)
class Windows:
    """A log cut into blocks of windows."""

    blocks: tuple[Block, ...]
    dt: float  # period [s]
    length: int  # periods of a window
    longest: int  # periods of history before every window

    @property
    def count(self) -> int:
        """How many windows there are."""
        return sum(len(b.moved) for b in self.blocks)


class Moments(NamedTuple):
    """Second moments of each block's windows; the last row and column are the target."""

    along: Array  # of [Re Z, -Im Z, Re d], (B, 2 T + 1, 2 T + 1)
    across: Array  # of [Im Z, Re Z, Im d], as many
    heading: Array  # of [W, turn], (B, T + 1, T + 1)


def cut(dataset: Dataset, longest: int, length: int, seconds: float) -> Windows:
    """Cut a log into blocks of at least `seconds`.

    `dataset`: episodes; those too short for a history and a window are left out. `longest`: periods
    of history before every window. `length`: periods of a window. `seconds`: length of a block [s],
    at least that of a window, longer in a long log; an episode's remainder joins its last stretch.
    """
    size = max(length + 1, round(seconds / dataset.dt))
    stretches = []
    for episode in dataset.episodes:
        start = longest
        while len(episode) - start >= length:
            stop = start + size
            if len(episode) - stop < max(length, size // 2):
                stop = len(episode)
            stretches.append(
                (episode.states[start : stop + 1], episode.inputs[start - longest : stop])
            )
            start = stop
    together = -(-len(stretches) // MOST_BLOCKS) if stretches else 1
    parts = [stretches[k : k + together] for k in range(0, len(stretches), together)]
    steered = dataset.steered
    blocks = tuple(_block(part, length, longest, dataset.dt, steered) for part in parts)
    return Windows(blocks, dataset.dt, length, longest)


def _block(
    stretches: list[tuple[Array, Array]], length: int, longest: int, dt: float, steered: bool
) -> Block:
    """Geometry of stretches of states (T + 1, 3) with their commands (longest + T, m)."""
    rows, turned, starts, frames, moves, headings = [], [], [], [], [], []
    first_row = first_period = 0
    for states, inputs in stretches:
        periods = len(states) - 1
        heading = states[:, 2]
        facing = np.exp(1j * heading)
        # Simpson's rule; the middle heading is the mean, which is exact for a held turn rate
        middle = np.exp(0.5j * (heading[:-1] + heading[1:]))
        turned.append((facing[:-1] + 4.0 * middle + facing[1:]) * (dt / 6.0))
        frame = np.exp(-0.5j * (heading[:-length] + heading[length:]))
        position = states[:, 0] + 1j * states[:, 1]
        frames.append(frame)
        moves.append((position[length:] - position[:-length]) * frame)
        headings.append(heading[length:] - heading[:-length])
        rows.append(first_row + longest + np.arange(periods))
        starts.append(first_period + np.arange(periods - length + 1))
        first_row += len(inputs)
        first_period += periods
    return Block(
        np.concatenate([inputs for _, inputs in stretches]),
        np.concatenate(rows),
        np.concatenate(turned),
        np.concatenate(starts),
        np.concatenate(frames),
        np.concatenate(moves),
        np.concatenate(headings),
        np.concatenate([held_curvatures(u) for _, u in stretches]) if steered else None,
    )


def _answered(block: Block, speed: Sequence[float], turn: Sequence[float]) -> Array:
    """Commands (T, m) of a block after the motors' response, given its weights, newest first."""
    told = block.inputs
    if block.curvatures is not None:
        told = np.column_stack([told[:, 0], block.curvatures])
    answered = np.zeros((len(block.rows), told.shape[1]))
    for columns, weights in ((slice(-1), speed), (slice(-1, None), turn)):
        for age, weight in enumerate(weights):
            answered[:, columns] += weight * told[block.rows - age, columns]
    if block.curvatures is not None:
        answered[:, 1] *= answered[:, 0]
    return answered


def _window_sums(values: Array, block: Block, length: int) -> Array:
    """Sum the rows (T, m) of a block's periods over each window: (S, m)."""
    total = np.zeros((len(values) + 1, values.shape[1]), dtype=values.dtype)
    np.cumsum(values, axis=0, out=total[1:])
    sums: Array = total[block.starts + length] - total[block.starts]
    return sums


def moments(
    windows: Windows,
    speed: Sequence[float],
    turn: Sequence[float],
    smoothing: Sequence[float],
    limits: Sequence[float],
) -> Moments:
    """Sum each block's windows for one response of the motors, given by its weights."""
    n, sums = windows.length, []
    for block in windows.blocks:
        w = evaluate_terms(_answered(block, speed, turn), smoothing, limits)
        z = _window_sums(block.turned[:, None] * w, block, n) * block.frame[:, None]
        one = np.column_stack([z.real, -z.imag, block.moved.real])
        other = np.column_stack([z.imag, z.real, block.moved.imag])
        third = np.column_stack([_window_sums(w, block, n) * windows.dt, block.heading])
        sums.append([rows.T @ rows for rows in (one, other, third)])
    return Moments(*(np.array(each) for each in zip(*sums, strict=True)))


def squared_errors(moment: Array, weights: Array) -> Array:
    """Squared errors of each block, (..., B): moments (B, p + 1, p + 1), weights (..., p)."""
    v = np.concatenate([weights, np.full((*weights.shape[:-1], 1), -1.0)], axis=-1)
    errors: Array = np.maximum(np.einsum("bij,...i,...j->...b", moment, v, v, optimize=True), 0.0)
    return errors


def largest_inputs(inputs: Array) -> tuple[float, ...]:
    """Largest size of each number of inputs (n, m), single outliers left out; never zero."""
    return tuple(np.maximum(np.quantile(np.abs(inputs), 0.995, axis=0), 1e-6).tolist())
