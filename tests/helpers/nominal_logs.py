"""Logs of nominal robots, and open-loop errors by the same starts for all models."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

DT = 0.1  # period of the logs [s]
REFERENCE_START = 0.5
"""Predictions start this long after the beginning of a drive [s], whatever a model's history."""
AHEAD = 1.0  # how far ahead predictions are judged [s]


def open_loop_errors(
    model: KoopmanModel,
    episodes: Iterable[Episode],
    first: float = REFERENCE_START,
    truth: Iterable[Array] | None = None,
) -> list[Array]:
    """Errors along, across [m] and of the heading [rad] of each episode's predictions, (n, 3) each.

    `model`: predicts from the measured pose at each start. `episodes`: drives with measured poses.
    `first`: where predictions start [s]; the history of the model must fit before. `truth`:
    noise-free poses (T + 1, 3) to judge by.
    """
    drives = list(episodes)
    poses = [e.states for e in drives] if truth is None else list(truth)
    steps, begin = max(1, round(AHEAD / model.dt)), round(first / model.dt)
    if begin < model.history:
        raise DataError(
            f"a history of {model.history} periods does not fit before starts at {first:g} s"
        )
    errors = []
    for episode, true in zip(drives, poses, strict=True):
        starts = np.arange(begin, len(episode) - steps + 1)
        if not len(starts):
            continue
        rows = starts[:, None] + np.arange(-model.history, steps)
        inputs = episode.inputs[rows]
        x = episode.states[starts]
        ends = model.rollout(x, inputs[:, model.history :], inputs[:, : model.history])[:, -1]
        errors.append(seen_along(ends - true[starts + steps], x[:, 2]))
    return errors


def nominal_log(seed: int, seconds: float = 60.0) -> Dataset:
    """A log of a robot that is nominal but for noise: its own, which lasts, and that of its poses.

    Speeds, and the size and the duration of every noise, are drawn at random.
    """
    random = np.random.default_rng(seed)
    steps = round(seconds / DT)
    largest = np.exp(random.uniform(np.log([0.2, 0.5]), np.log([3.0, 2.5])))
    inputs = np.zeros((steps, 2))
    k = 0
    while k < steps:
        held = int(random.integers(3, 25))
        inputs[k : k + held] = random.uniform(-1.0, 1.0, 2) * largest
        k += held
    forgets = np.exp(-DT / np.exp(random.uniform(np.log(0.1), np.log(2.0))))
    sizes = random.uniform(0.0, 0.1, 3)
    gains = np.empty((steps, 3))
    state = random.normal(size=3)
    for k in range(steps):
        state = forgets * state + np.sqrt(1.0 - forgets**2) * random.normal(size=3)
        gains[k] = sizes * state
    forward, left = inputs[:, 0] * (1.0 + gains[:, 0]), inputs[:, 0] * gains[:, 1]
    turn = inputs[:, 1] * (1.0 + gains[:, 2]) * DT
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    chord = (forward + 1j * left) * DT * np.sinc(turn / (2.0 * np.pi))
    position = np.cumsum(np.concatenate([[0.0], chord * np.exp(1j * (heading[:-1] + turn / 2))]))
    poses = np.stack([position.real, position.imag, heading], axis=1)
    low, high = np.log([0.001, 0.001, 0.002]), np.log([0.02, 0.02, 0.05])
    poses = poses + random.normal(size=poses.shape) * np.exp(random.uniform(low, high))
    return Dataset([Episode(poses, inputs, DT)])
