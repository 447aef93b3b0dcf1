"""How a robot comes to a stop.

Of a stop, a command that falls by `deceleration` is followed `delay` later. If the robot drives on
farther than that, by more than chance, the deceleration is what its way to a standstill shows
instead.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.learn.lag import mean_delay
from kmpc_lite.learn.windows import largest_inputs
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

STANDING, FAST, FALLS = 0.1, 0.5, 0.005
"""Shares of the largest speed: below which a robot counts as commanded to stand; from which a stop
begins, at least; by which a command falls from one row to the next, at least."""
REST = 0.5
"""How long the robot is commanded to stand, at least [s]."""
FEWEST, SURE = 2, 2.0
"""Stops from which on something is said; standard errors by which the robot must drive on farther
than predicted."""


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

    `speeds`: commanded speeds, one a period, (T,) [m/s or rad/s]. `dt`: period [s]. `largest`:
    largest speed of the robot, of the same unit.
    """
    size = np.abs(speeds)
    still = np.concatenate([[False], size <= STANDING * largest, [False]])
    ends = np.flatnonzero(still[1:] != still[:-1]).reshape(-1, 2)
    # where the command has fallen from one row to the next, without changing its sign
    falls = (np.diff(size) < -FALLS * largest) & (speeds[1:] * speeds[:-1] >= 0.0)
    found = []
    for rest, end in ends.tolist():
        begin = rest
        while begin > 0 and falls[begin - 1]:
            begin -= 1
        rests = (end - rest) * dt >= REST - 1e-9
        if rests and begin < rest and size[begin] >= FAST * largest:
            found.append(Stop(begin + 1, rest, end))
    return found


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

    `model`: learned from the log: what it predicts of a stop is the lag's share of the way. `log`:
    all of it, those parts included that the model was not fitted to.
    """
    # as the model has learned it, else as the log shows it: the likeliest delay even where it is
    # not sure, for one that is given too short is a stop that comes too late
    response = model.info.get("response")
    delay = float(sum(response["speed"])) if isinstance(response, dict) else 0.0
    delay = delay or mean_delay(log, (0,), sure=False)
    largest, told, rows = largest_inputs(log.inputs)[0], [], []
    for episode in log.episodes:
        for stop in find_stops(episode.inputs[:, 0], episode.dt, largest):
            if stop.begin > model.history:
                told.append(_told_deceleration(episode, stop))
                energy = 0.5 * episode.inputs[stop.begin - 1, 0] ** 2
                rows.append((energy, _farther_than_predicted(model, episode, stop)))
    if len(told) < FEWEST:
        return Stopping(delay, len(told), None)
    # what is to be added to the inverse deceleration [s^2/m], where that is beyond chance
    energy, beyond = np.array(rows).T
    size = float(energy @ energy)
    found = float(energy @ beyond) / size
    rest = beyond - found * energy
    error = float(np.sqrt(rest @ rest / max(len(rows) - 1, 1) / size))
    excess = found + error if found > SURE * error else max(0.0, found)
    return Stopping(delay, len(told), 1.0 / (1.0 / float(np.median(told)) + excess))


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
    ahead = episode.states[stop.end] - model.rollout(start, inputs, past)[-1]
    heading = np.array([np.cos(start[2]), np.sin(start[2])])
    return float(np.sign(episode.inputs[first - 1, 0]) * heading @ ahead[:2])
