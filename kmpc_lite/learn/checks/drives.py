"""What refuses drives that no model can be made of, however they were read."""

from __future__ import annotations

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.unmodelled_delay import aligned, unmodelled_delay
from kmpc_lite.types import Array

NEVER_MOVES = (
    "the poses never move though the commands do, so the log does not excite the model: expected "
    "x, y, theta of the driving robot"
)


# by what a robot counts as car-like
SLOW = 0.1
"""Share of the largest speed below which a robot counts as standing."""
TURNING = 0.3
"""Share of the largest turn rate above which a robot is told to turn."""
SPOT = 1.0
"""Length of a stretch that shows a turn on the spot [s]."""
FEWEST = 3
"""Such stretches that are needed."""
FOLLOWS = 0.2
"""Share of its usual turn gain below which a robot does not turn on the spot."""


def refuse_frozen(dataset: Dataset) -> None:
    """Refuse a log whose poses never move though commands are given.

    Raises
    ------
    DataError
        Says so.
    """
    moved = max(float(np.abs(np.diff(e.states, axis=0)).max(initial=0.0)) for e in dataset.episodes)
    asked = max(float(np.abs(e.inputs).max(initial=0.0)) for e in dataset.episodes)
    if moved <= 1e-9 < asked:
        raise DataError(NEVER_MOVES)


def refuse_car_like(dataset: Dataset) -> None:
    """Refuse a robot that is told to turn on the spot and does not, however late it answers.

    Raises
    ------
    DataError
        With what the log shows.
    """
    delay = unmodelled_delay(dataset)
    answered = aligned(dataset, delay) if delay else dataset
    asked, turned, speeds = _windows(answered, max(1, round(SPOT / dataset.dt)))
    v_max, omega_max = np.abs(speeds).max(initial=0.0), np.abs(asked).max(initial=0.0)
    turning = np.abs(asked) > TURNING * omega_max
    on_the_spot = turning & (speeds < SLOW * v_max)
    driving = turning & (speeds > 3.0 * SLOW * v_max)
    if on_the_spot.sum() < FEWEST or driving.sum() < FEWEST:
        return
    spot, usual = (
        float(asked[rows] @ turned[rows] / (asked[rows] @ asked[rows]))
        for rows in (on_the_spot, driving)
    )
    if abs(usual) > 0.05 and abs(spot) < FOLLOWS * abs(usual):
        raise DataError(
            "this robot does not turn on the spot: told to, it turns by "
            f"{spot:.2f} of the command while it stands, {usual:.2f} while it drives. Car-like "
            "robots are not supported; plans here turn on the spot"
        )


def _windows(dataset: Dataset, length: int) -> tuple[Array, Array, Array]:
    """Asked turns [rad], turns [rad] and largest |v| [m/s] of stretches that do not overlap."""
    asked, turned, speeds = [], [], []
    for episode in dataset.episodes:
        for k in range(0, len(episode) - length + 1, length):
            inputs = episode.inputs[k : k + length]
            asked.append(inputs[:, 1].sum() * dataset.dt)
            turned.append(episode.states[k + length, 2] - episode.states[k, 2])
            speeds.append(np.abs(inputs[:, 0]).max())
    return np.array(asked), np.array(turned), np.array(speeds)
