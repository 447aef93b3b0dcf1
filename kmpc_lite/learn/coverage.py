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

TURNING, FAST = 0.3, 0.6
"""Share of the largest turn rate above which a robot is commanded to turn; of the largest speed
that parts slow driving from fast driving."""
WHOLE, DIRECTION, COMBINATION, STOPS = 60.0, 4.0, 2.0, 2.0
"""How much a log must show: its length; driving in each direction, slowly and fast, and turning
each way; turning each way while driving each way, and on the spot [s]; and stops from speed."""


class Words(NamedTuple):
    """How a way of driving is called."""

    verb: str
    """What the robot does then: ``reverses``."""
    advice: str
    """How it is recorded."""
    noun: str
    """What a log lacks without it."""


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

    name: str
    """Of `WORDS`."""
    shown: float
    """[s], or a number of stops."""
    needed: float
    """The same unit."""

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
