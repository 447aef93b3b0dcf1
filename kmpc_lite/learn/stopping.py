"""How late a robot answers its commands, and how it comes to a stop.

A model without input history moves with the command of the present period. If the log shows that
the robot answers later, the delay is kept beside the model, and the controller brings poses forward
by it: a pose that shows old commands is an old pose to a robot that obeys at once.

Of a stop, a command that falls by `deceleration` is followed `delay` later. If the robot drives on
farther than that, by more than chance, the deceleration is what its way to a standstill shows
instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.episode import Episode
from kmpc_lite.learn.windows import largest_speeds
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

LONGEST = 1.0
"""Longest delay that is looked for [s] ..."""
MOST_PERIODS = 12
"""... and in periods."""
PARTS = 4
"""Delays that are tried in a period."""
BLOCKS = 16
"""Parts of the log that must agree."""
SURE_DELAY = 3.0
"""Standard errors by which a delay must explain more than none."""
MOST_STEPS = 40_000
"""Steps of the log that are looked at."""


def unmodelled_delay(
    dataset: Dataset, axes: Sequence[int] | None = None, sure: float = SURE_DELAY
) -> float:
    """Mean delay of speed and turn rate behind their commands [s]; zero if none is sure.

    Parameters
    ----------
    dataset : Dataset
        Evenly sampled episodes.
    axes : sequence of int, optional
        Which numbers of a command are looked at; all if not given.
    sure : float
        Standard errors by which a delay must explain more than none.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> unmodelled_delay(generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0))
    0.0
    """
    # a delay costs each episode its first rows
    spare = int(np.median([len(episode) for episode in dataset.episodes])) // 4
    lags = min(MOST_PERIODS, round(LONGEST / dataset.dt), spare)
    if lags < 1:
        return 0.0
    asked, moved = _rows(dataset, lags, 1, MOST_STEPS)
    if len(moved) < 4 * BLOCKS:
        return 0.0
    axes = list(range(dataset.commands) if axes is None else axes)
    asked, moved = asked[..., axes], moved[:, axes]
    tried = np.arange(PARTS * lags + 1) / PARTS
    errors = np.stack([_errors(asked, moved, delay, BLOCKS) for delay in tried])
    gain = errors[0] - errors[int(errors.sum(axis=1).argmin())]
    spread = float(gain.std(ddof=1)) / len(gain) ** 0.5
    if not gain.mean() > sure * spread:
        return 0.0
    # slowly changing motion shows the mean of an answer that is drawn out
    asked, moved = _rows(dataset, lags, lags, MOST_STEPS)
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
            episodes.append(replace(episode, states=episode.states[first:], inputs=late))
    return Dataset(episodes)


def _rows(dataset: Dataset, lags: int, length: int, most: int) -> tuple[Array, Array]:
    """Commands (n, lags + 1, m), the newest first, and speeds that came of them (n, m).

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
        return np.empty((0, lags + 1, dataset.commands)), np.empty((0, dataset.commands))
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


STANDING = 0.1
"""Share of the largest speed below which a robot counts as commanded to stand, and of the largest
turn rate below which it counts as commanded to drive straight on."""
FAST = 0.5
"""Share of the largest speed from which a stop begins, at least."""
REST = 0.5
"""How long the robot is commanded to stand, at least [s]."""
FALLS = 0.005
"""Share of the largest speed by which a command falls from one row to the next, at least."""


class Stop(NamedTuple):
    """Rows of one stop."""

    begin: int
    """First row whose command is slower than the one before."""
    rest: int
    """First row that tells the robot to stand."""
    end: int
    """First row that tells it to move again, or the number of rows."""


def find_stops(speeds: Array, dt: float, largest: float) -> list[Stop]:
    """Find the stops from speed in one stretch of commands.

    Parameters
    ----------
    speeds : ndarray
        Commanded speeds, one a period, (T,) [m/s or rad/s].
    dt : float
        Period [s].
    largest : float
        Largest speed of the robot, of the same unit.
    """
    size = np.abs(speeds)
    still = np.concatenate([[False], size <= STANDING * largest, [False]])
    begins = np.flatnonzero(~still[:-1] & still[1:])
    ends = np.flatnonzero(still[:-1] & ~still[1:])
    # where the command has fallen from one row to the next, without changing its sign
    falls = (np.diff(size) < -FALLS * largest) & (speeds[1:] * speeds[:-1] >= 0.0)
    found = []
    for rest, end in zip(begins, ends, strict=True):
        begin = rest
        while begin > 0 and falls[begin - 1]:
            begin -= 1
        rests = (end - rest) * dt >= REST - 1e-9
        if rests and begin < rest and size[begin] >= FAST * largest:
            found.append(Stop(int(begin) + 1, int(rest), int(end)))
    return found


FEWEST = 2
"""Stops from which on something is said."""
SURE = 2.0
"""Standard errors by which the robot must drive on farther than predicted."""


@dataclass(frozen=True)
class Stopping:
    """What a log shows of stopping."""

    delay: float
    """How late the motion comes [s]."""
    stops: int
    """Stops from speed in the log."""
    deceleration: float | None
    """Deceleration that the robot followed [m/s^2]; None if the log holds too few stops."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    def distance(self, speed: float) -> float | None:
        """Way from a speed [m/s] to a standstill [m], once the robot is commanded to stop."""
        if self.deceleration is None:
            return None
        return speed * self.delay + speed**2 / (2.0 * self.deceleration)


def measure_stopping(model: KoopmanModel, log: Dataset) -> Stopping:
    """Measure delay and deceleration of the robot in a log.

    Parameters
    ----------
    model : KoopmanModel
        Learned from the log: what it predicts of a stop is the lag's share of the way.
    log : Dataset
        All of it, those parts included that the model was not fitted to.
    """
    largest = largest_speeds(log)[0]
    told, beyond, energy = [], [], []
    for episode in log.episodes:
        for stop in find_stops(episode.inputs[:, 0], episode.dt, largest):
            if stop.begin > model.history:
                told.append(_told_deceleration(episode, stop))
                beyond.append(_farther_than_predicted(model, episode, stop))
                energy.append(0.5 * episode.inputs[stop.begin - 1, 0] ** 2)
    delay = _delay(model, log)
    if len(told) < FEWEST:
        return Stopping(delay, len(told), None)
    slowness = 1.0 / float(np.median(told))
    slowness += _excess(np.array(beyond), np.array(energy))
    return Stopping(delay, len(told), 1.0 / slowness)


def _told_deceleration(episode: Episode, stop: Stop) -> float:
    """Deceleration of the command: its steepest fall, and no more than the whole way tells."""
    falling = np.abs(episode.inputs[stop.begin - 1 : stop.end, 0])
    steepest = -float(np.diff(falling).min()) / episode.dt
    way = float(falling[1:].sum()) * episode.dt
    return min(steepest, float(falling[0]) ** 2 / (2.0 * way)) if way > 0.0 else steepest


def _farther_than_predicted(model: KoopmanModel, episode: Episode, stop: Stop) -> float:
    """How much farther the robot went than the model says, in its direction of travel [m]."""
    first = stop.begin
    past = episode.inputs[first - model.history : first] if model.history else None
    start, inputs = episode.states[first], episode.inputs[first : stop.end]
    predicted = model.rollout(start, inputs, past)[-1]
    heading = np.array([np.cos(start[2]), np.sin(start[2])])
    sign = np.sign(episode.inputs[first - 1, 0])
    return float(sign * heading @ (episode.states[stop.end] - predicted)[:2])


def _excess(beyond: Array, energy: Array) -> float:
    """What is to be added to the inverse deceleration [s^2/m], where that is beyond chance."""
    size = float(energy @ energy)
    found = float(energy @ beyond) / size
    rest = beyond - found * energy
    error = float(np.sqrt(rest @ rest / max(len(beyond) - 1, 1) / size))
    return found + error if found > SURE * error else max(0.0, found)


def _delay(model: KoopmanModel, log: Dataset) -> float:
    """How late the motion along the heading follows the commanded speed [s].

    As the model has learned it, else as the log shows it: the likeliest delay even where it is not
    sure, for one that is given too short is a stop that comes too late.
    """
    response = model.info.get("response")
    known = float(sum(response["speed"])) if isinstance(response, dict) else 0.0
    return known or unmodelled_delay(log, (0,), sure=0.0)
