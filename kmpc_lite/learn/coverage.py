"""How much of a robot's ways of driving a log shows: the one rule of `kmpc record` and `kmpc fit`.

A model is a guess wherever its log shows too little. `kmpc record` shows the shares while it
drives, `kmpc fit` warns of what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.stopping import STANDING, find_stops
from kmpc_lite.learn.windows import largest_inputs
from kmpc_lite.types import Array

TURNING = 0.3
"""Share of the largest turn rate above which a robot is commanded to turn."""
FAST = 0.6
"""Share of the largest speed that parts slow driving from fast driving."""
# how much a log must show of each way of driving
WHOLE = 60.0
"""Length of the log [s]."""
DIRECTION = 4.0
"""Driving in each direction, slowly and fast, and turning each way [s]."""
COMBINATION = 2.0
"""Turning each way while driving each way, and on the spot [s]."""
STOPS = 2
"""Stops from speed."""


class Part(NamedTuple):
    """One way of driving, and how much of it a log shows."""

    name: str
    verb: str
    """What the robot does then: ``reverses``."""
    advice: str
    """How it is recorded."""
    shown: float
    """[s], or a number of stops."""
    needed: float
    """The same unit."""
    of: tuple[str, ...] = ()
    """Parts without which this one cannot be."""

    @property
    def share(self) -> float:
        """Share of what is needed, at most 1."""
        return min(1.0, self.shown / self.needed)

    @property
    def is_shown(self) -> bool:
        """Whether it is enough."""
        return self.shown >= self.needed - 1e-6

    @property
    def is_absent(self) -> bool:
        """Whether there is so little of it that nothing is learned from it."""
        return self.shown <= 0.1 * self.needed

    @property
    def amount(self) -> str:
        """How much of how much."""
        unit = "" if self.name == "stops" else " s"
        return f"{self.shown:.3g} of {self.needed:g}{unit}"


@dataclass(frozen=True)
class Coverage:
    """What a log shows, part by part."""

    parts: tuple[Part, ...]
    tightest: float = 0.0
    """Radius of the tightest turns in the log [m]; 0 if it turns on the spot."""

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
        return [f"{part.name}: {part.amount}: {part.advice}" for part in self.missing]

    def warnings(self) -> list[str]:
        """What a model of this log does not know, one line a part."""
        return [_warning(part, self.tightest) for part in self.missing]


def _warning(part: Part, tightest: float) -> str:
    """Say what a log shows too little of; its tightest turns have that radius [m]."""
    if part.name == "length":
        return f"only {part.shown:.0f} s were driven: drive for minutes"
    if not part.is_absent:
        return f"the log hardly {part.verb} ({part.amount})"
    if part.name == "on the spot":
        tight = f", nor tighter than on {tightest:.2g} m" if tightest > 0.0 else ""
        return (
            f"the log never turns on the spot{tight}: whether this robot can is not known; "
            'a car, which cannot, is driven with wheels = {kind = "car", ...}'
        )
    return f"the log never {part.verb}: the model guesses how"


def find_coverage(
    stretches: Sequence[Array],
    dt: float,
    limits: tuple[float, float, float] | None = None,
    steered: bool = False,
) -> Coverage:
    """Tell how much of each way of driving a log shows.

    Parameters
    ----------
    stretches : sequence of ndarray
        Commands of each stretch without a gap, one row a period, (T, m).
    dt : float
        Period [s].
    limits : tuple, optional
        Largest speed forward and back [m/s] and turn rate [rad/s] that the robot is to drive; the
        largest of the log if not given. A robot that must not reverse has zero for back.
    steered : bool
        Whether it is a car, which cannot turn on the spot.
    """
    rows = np.concatenate([np.empty((0, 2)), *(np.asarray(s)[:, [0, -1]] for s in stretches)])
    if limits is None:
        v_max, turn = largest_inputs(rows) if len(rows) else (0.0, 0.0)
        limits = v_max, v_max, turn
    fastest = max(*limits[:2], 1e-9)
    v, omega = rows[:, 0] / fastest, rows[:, 1] / max(limits[2], 1e-9)
    parts = [Part("length", "", "drive for longer", len(rows) * dt, WHOLE)]
    parts += _seconds_of(v, omega, dt, limits[1] > 0.0)[: -1 if steered else None]
    speeds = [np.asarray(stretch)[:, 0] for stretch in stretches]
    stops = sum(len(find_stops(s, dt, fastest)) for s in speeds)
    advice = "stop from full speed, and stand for a second"
    stop = Part("stops", "stops from speed", advice, float(stops), float(STOPS))
    return Coverage((*parts, stop), _tightest(v * fastest, omega * limits[2]))


def _tightest(v: Array, omega: Array) -> float:
    """Radius of the tightest turns, single rows left out [m]; 0 if nothing turns."""
    turning = np.abs(omega) > TURNING * max(float(np.abs(omega).max(initial=0.0)), 1e-9)
    if not turning.any():
        return 0.0
    return float(np.quantile(np.abs(v[turning] / omega[turning]), 0.02))


def _seconds_of(v: Array, omega: Array, dt: float, reverses: bool) -> list[Part]:
    """Parts that are measured in seconds; speeds are shares of the largest."""
    ahead, back = v > STANDING, v < -STANDING
    moving, fast = ahead | back, np.abs(v) > FAST
    need, less = DIRECTION, COMBINATION
    ways = [("forward", "drives forward", "driving forward", ahead)]
    ways += [("reverse", "reverses", "reversing", back)] if reverses else []

    def seconds(rows: Array) -> float:
        return float(rows.sum()) * dt

    parts = [
        Part(name, verb, "drive forward" if name == "forward" else "reverse", seconds(m), need)
        for name, verb, _, m in ways
    ]
    parts += [
        Part(
            "slow", "drives slowly", "drive at less than half speed", seconds(moving & ~fast), need
        ),
        Part("fast", "drives fast", "drive at full speed", seconds(fast), need),
    ]
    spots = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turning = sign * omega > TURNING
        shown = seconds(sign * omega > STANDING)
        parts.append(Part(side, f"turns {side}", f"turn {side}", shown, need))
        for name, verb, doing, way in ways:
            label, told = f"{name}, {side}", f"turn {side} while {doing}"
            said = f"turns {side} while it {verb}"
            parts.append(Part(label, said, told, seconds(turning & way), less, (name, side)))
        spots.append(seconds(turning & ~moving))
    parts.append(
        Part(
            "on the spot",
            "turns on the spot both ways",
            "turn on the spot, left and right",
            2.0 * min(spots),
            2.0 * less,
            ("left", "right"),
        )
    )
    return parts
