"""How late a robot answers: for a model that does not know it, and for the way that it stops in.

A model without input history moves with the command of the present period. Where the log shows that
the robot answers later, the delay is kept beside the model, and the controller brings poses forward
by it: a pose that shows old commands is an old pose to a robot that obeys at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.episode import Episode
from kmpc_lite.types import INPUTS, Array


@dataclass(frozen=True)
class DelayOptions:
    """How a delay is looked for."""

    longest: float = 1.0
    """[s]."""
    most_periods: int = 12
    """The same in periods."""
    parts: int = 4
    """Delays that are tried in a period."""
    blocks: int = 16
    """Parts of the log that must agree."""
    sure: float = 3.0
    """Standard errors by which a delay must explain more than none."""
    most_steps: int = 40_000
    """Steps of the log that are looked at."""
    axes: tuple[int, ...] = (0, 1)
    """Which of speed (0) and turn rate (1) are looked at."""


def unmodelled_delay(dataset: Dataset, options: DelayOptions | None = None) -> float:
    """Mean delay of speed and turn rate behind their commands [s]; zero where none is sure.

    Parameters
    ----------
    dataset : Dataset
        Evenly sampled episodes.
    options : DelayOptions, optional
        How it is looked for.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> unmodelled_delay(generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0))
    0.0
    """
    options = DelayOptions() if options is None else options
    # a delay costs each episode its first rows
    spare = int(np.median([len(episode) for episode in dataset.episodes])) // 4
    lags = min(options.most_periods, round(options.longest / dataset.dt), spare)
    if lags < 1:
        return 0.0
    asked, moved = _rows(dataset, lags, 1, options.most_steps)
    if len(moved) < 4 * options.blocks:
        return 0.0
    axes = list(options.axes)
    asked, moved = asked[..., axes], moved[:, axes]
    tried = np.arange(options.parts * lags + 1) / options.parts
    errors = np.stack([_errors(asked, moved, delay, options.blocks) for delay in tried])
    gain = errors[0] - errors[int(errors.sum(axis=1).argmin())]
    spread = float(gain.std(ddof=1)) / len(gain) ** 0.5
    if not gain.mean() > options.sure * spread:
        return 0.0
    # slowly changing motion shows the mean of an answer that is drawn out
    asked, moved = _rows(dataset, lags, lags, options.most_steps)
    asked, moved = asked[..., axes], moved[:, axes]
    left = [float(_errors(asked, moved, delay, 1)[0]) for delay in tried]
    return dataset.dt * float(tried[int(np.argmin(left))])


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
            episodes.append(Episode(episode.states[first:], late, episode.dt))
    return Dataset(episodes)


def _rows(dataset: Dataset, lags: int, length: int, most: int) -> tuple[Array, Array]:
    """Commands (n, lags + 1, 2), the newest first, and speeds that came of them (n, 2).

    Each row is the mean of `length` periods, of at most about `most` rows.
    """
    asked, moved, count = [], [], 0
    for episode in dataset.episodes:
        if len(episode) < lags + length:
            continue
        rows = np.arange(lags, len(episode))
        late = episode.inputs[rows[:, None] - np.arange(lags + 1)]
        asked.append(_moving_mean(late, length))
        moved.append(_moving_mean(episode.moved[rows] / episode.dt, length))
        count += len(moved[-1])
        if count >= most:
            break
    if not asked:
        return np.empty((0, lags + 1, INPUTS)), np.empty((0, INPUTS))
    return np.concatenate(asked), np.concatenate(moved)


def _moving_mean(rows: Array, length: int) -> Array:
    """Means of so many rows in a row, (n - length + 1, ...)."""
    sums = np.cumsum(np.concatenate([np.zeros_like(rows[:1]), rows]), axis=0)
    means: Array = (sums[length:] - sums[:-length]) / length
    return means


def _errors(asked: Array, moved: Array, delay: float, blocks: int) -> Array:
    """Share (blocks,) of the motion that the best gains leave, for commands after a delay."""
    whole = min(int(delay), asked.shape[1] - 2)
    late = asked[:, whole] + (delay - whole) * (asked[:, whole + 1] - asked[:, whole])
    gains = np.sum(late * moved, axis=0) / np.maximum(np.sum(late**2, axis=0), 1e-12)
    size = np.maximum(np.mean(moved**2, axis=0), 1e-12)
    left = np.sum((moved - gains * late) ** 2 / size, axis=1)
    return np.array([part.mean() for part in np.array_split(left, blocks)])
