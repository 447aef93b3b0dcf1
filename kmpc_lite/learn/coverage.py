"""How much of a robot's ways of driving a log shows, and how the robot comes to a stop in it.

A model is a guess wherever its log shows too little. `kmpc record` shows the shares while it
drives, `kmpc fit` warns of what is missing.

Of a stop, a command that falls by `deceleration` is followed `delay` later. If the robot drives on
farther than that, by more than chance, the deceleration is what its way to a standstill shows
instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.learn.lag import mean_delay
from kmpc_lite.learn.windows import largest_inputs
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

STANDING, STOPS_FROM, FALLS = 0.1, 0.5, 0.005
"""Shares of the largest speed: below which a robot counts as commanded to stand; from which a stop
begins, at least; by which a command falls from one row to the next, at least."""
REST = 0.5  # how long the robot is commanded to stand, at least [s]
FEWEST, SURE = 2, 2.0
"""Stops from which on something is said; standard errors by which the robot must drive on farther
than predicted."""
TURNING, FAST = 0.3, 0.6
"""Share of the largest turn rate above which a robot is commanded to turn; of the largest speed
that parts slow driving from fast driving."""
WHOLE, DIRECTION, COMBINATION, STOPS = 60.0, 4.0, 2.0, 2.0
"""How much a log must show: its length; driving in each direction, slowly and fast, and turning
each way; turning each way while driving each way, and on the spot [s]; and stops from speed."""


class Stop(NamedTuple):
    """Rows of one stop."""

    begin: int  # first row whose command is slower than the one before
    rest: int  # first row that tells the robot to stand
    end: int  # first row that tells it to move again, or the number of rows


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
        if rests and begin < rest and size[begin] >= STOPS_FROM * largest:
            found.append(Stop(begin + 1, rest, end))
    return found


@dataclass(frozen=True)
class Stopping:
    """What a log shows of stopping."""

    delay: float  # how late the motion comes [s]
    stops: int  # stops from speed in the log
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


class Words(NamedTuple):
    """How a way of driving is called."""

    verb: str  # what the robot does then: ``reverses``
    advice: str  # how it is recorded
    noun: str  # what a log lacks without it


WORDS = {
    "length": Words("", "drive for longer", "minutes of driving"),
    "forward": Words("drives forward", "drive forward", "driving forward"),
    "reverse": Words("reverses", "reverse", "reversing"),
    "slow": Words("drives slowly", "drive at less than half speed", "slow driving"),
    "fast": Words("drives fast", "drive at full speed", "fast driving"),
    **{side: Words(f"turns {side}", f"turn {side}", f"{side} turns") for side in ("left", "right")},
    **{
        f"{way}, {side}": Words(
            f"turns {side} while it {verb}",
            f"turn {side} while {doing}",
            f"{side} turns while {doing}",
        )
        for way, verb, doing in (
            ("forward", "drives forward", "driving forward"),
            ("reverse", "reverses", "reversing"),
        )
        for side in ("left", "right")
    },
    "on the spot": Words(
        "turns on the spot both ways", "turn on the spot, left and right", "turns on the spot"
    ),
    "stops": Words("stops from speed", "stop from full speed, and stand for a second", "stops"),
}
"""By the name of the way of driving."""


class Part(NamedTuple):
    """One way of driving, and how much of it a log shows."""

    name: str  # of `WORDS`
    shown: float  # [s], or a number of stops
    needed: float  # the same unit

    @property
    def of(self) -> tuple[str, ...]:
        """Parts without which this one cannot be."""
        parts = "left, right" if self.name == "on the spot" else self.name
        return tuple(parts.split(", ")) if ", " in parts else ()

    @property
    def share(self) -> float:
        """Share of what is needed, at most 1."""
        return min(1.0, self.shown / self.needed)

    @property
    def is_shown(self) -> bool:
        """Whether it is enough."""
        return self.shown >= self.needed - 1e-6

    @property
    def amount(self) -> str:
        """How much of how much."""
        unit = "" if self.name == "stops" else " s"
        return f"{self.shown:.3g} of {self.needed:g}{unit}"


@dataclass(frozen=True)
class Coverage:
    """What a log shows, part by part."""

    parts: tuple[Part, ...]
    tightest: float = 0.0  # radius of the tightest turns in the log [m]; 0 if it turns on the spot

    @property
    def is_complete(self) -> bool:
        """Whether every part is shown."""
        return all(part.is_shown for part in self.parts)

    @property
    def missing(self) -> tuple[Part, ...]:
        """Parts of which there is too little; those that follow from another are left out."""
        lacking = {part.name for part in self.parts if not part.is_shown}
        return tuple(p for p in self.parts if p.name in lacking and lacking.isdisjoint(p.of))

    def as_dict(self) -> dict[str, float]:
        """Share of each part, for JSON."""
        return {part.name: round(part.share, 3) for part in self.parts}

    def advice(self) -> list[str]:
        """What is missing and how it is recorded, one line a part."""
        return [f"{part.name}: {part.amount}: {WORDS[part.name].advice}" for part in self.missing]

    def warnings(self) -> list[str]:
        """What a model of this log does not know, one line a part."""
        return [_warning(part, self.tightest) for part in self.missing]


def _warning(part: Part, tightest: float) -> str:
    """Say what a log shows too little of; its tightest turns have that radius [m]."""
    if part.name == "length":
        return f"only {part.shown:.0f} s were driven: drive for minutes"
    verb = WORDS[part.name].verb
    if part.share > 0.1:
        return f"the log hardly {verb} ({part.amount})"
    if part.name == "on the spot":
        tight = f", nor tighter than on {tightest:.2g} m" if tightest > 0.0 else ""
        return (
            f"the log never turns on the spot{tight}: whether this robot can is not known; "
            'a car, which cannot, is driven with wheels = {kind = "car", ...}'
        )
    return f"the log never {verb}: the model guesses how"


def find_coverage(
    stretches: Sequence[Array],
    dt: float,
    limits: tuple[float, float, float] | None = None,
    steered: bool = False,
) -> Coverage:
    """Tell how much of each way of driving a log shows.

    `stretches`: commands of each stretch without a gap, one row a period, (T, m). `dt`: period [s].
    `limits`: largest speed forward and back [m/s] and turn rate [rad/s] that the robot is to drive;
    the largest of the log if not given. A robot that must not reverse has zero for back. `steered`:
    whether it is a car, which cannot turn on the spot.
    """
    rows = np.concatenate([np.empty((0, 2)), *(np.asarray(s)[:, [0, -1]] for s in stretches)])
    if limits is None:
        v_max, turn = largest_inputs(rows) if len(rows) else (0.0, 0.0)
        limits = v_max, v_max, turn
    fastest = max(*limits[:2], 1e-9)
    v, omega = rows[:, 0] / fastest, rows[:, 1] / max(limits[2], 1e-9)
    parts = [Part("length", len(rows) * dt, WHOLE)]
    for name, shown in _driven(v, omega, limits[1] > 0.0).items():
        needed = COMBINATION if ", " in name else DIRECTION
        parts.append(Part(name, float(shown.sum()) * dt, needed))
    if not steered:
        spots = [rate[np.abs(v) <= STANDING] > TURNING for rate in (omega, -omega)]
        seconds = 2.0 * min(float(spot.sum()) * dt for spot in spots)
        parts.append(Part("on the spot", seconds, 2.0 * COMBINATION))
    stops = sum(len(find_stops(np.asarray(s)[:, 0], dt, fastest)) for s in stretches)
    parts.append(Part("stops", float(stops), STOPS))
    turning, tightest = np.abs(omega) > TURNING * max(np.abs(omega).max(initial=0.0), 1e-9), 0.0
    if turning.any():  # single rows left out
        radii = np.abs(v[turning] * fastest / (omega[turning] * max(limits[2], 1e-9)))
        tightest = float(np.quantile(radii, 0.02))
    return Coverage(tuple(parts), tightest)


def _driven(v: Array, omega: Array, reverses: bool) -> dict[str, Array]:
    """In which rows (T,) it drives in which way; speeds are shares of the largest."""
    ways = {"forward": v > STANDING, "reverse": v < -STANDING}
    moving, fast = ways["forward"] | ways["reverse"], np.abs(v) > FAST
    if not reverses:
        del ways["reverse"]
    found = {**ways, "slow": moving & ~fast, "fast": fast}
    for side, rate in (("left", omega), ("right", -omega)):
        found[side] = rate > STANDING
        found |= {f"{way}, {side}": (rate > TURNING) & rows for way, rows in ways.items()}
    return found
