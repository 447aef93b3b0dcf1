"""Whether a model predicts a drive better than the nominal robot: a paired test on its windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

import numpy as np

from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.episode import Episode
from kmpc_lite.learn.evaluation import as_triple
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.types import STATES, Array


class ModelVerdict(Enum):
    """What a comparison says."""

    BETTER = "predicts better than the nominal robot"
    WORSE = "predicts worse than the nominal robot"
    ALIKE = "predicts as the nominal robot does, and nothing hangs on the difference"
    UNSURE = "does not predict better than the nominal robot beyond noise"
    SHORT = "was driven too little to tell"


HORIZON = 1.0
"""How far ahead is predicted [s]; windows do not overlap."""
FEWEST = 10
"""Windows of driving from which on there is a verdict."""
SURE = 3.0
"""Standard errors by which one must predict better, in one direction at least, while the other
does so in none."""
ALIKE = 0.3
"""Predictions that differ by less than this share of what both err are alike."""
MOVING = 0.1
"""Share of the largest commands below which a window counts as standing."""


@dataclass(frozen=True)
class Comparison:
    """Errors of a model and of the nominal robot over the same windows."""

    verdict: ModelVerdict
    windows: int
    errors: tuple[float, float, float]
    """Along [m], across [m], heading [rad], root mean square."""
    nominal: tuple[float, float, float]
    """The same of the nominal robot."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "verdict": self.verdict.name}

    def __str__(self) -> str:
        """One line."""
        ours, theirs = (
            f"{1e3 * e[0]:.0f} mm, {1e3 * e[1]:.0f} mm, {1e3 * e[2]:.0f} mrad"
            for e in (self.errors, self.nominal)
        )
        told = f"{self.windows} windows of driving: {ours} against {theirs} nominal"
        return f"the model {self.verdict.value} ({told})"


def compare(model: KoopmanModel, episodes: Sequence[Episode]) -> Comparison:
    """Compare a model with the nominal robot on a drive.

    Parameters
    ----------
    model : KoopmanModel
        What was learned, not from this drive.
    episodes : sequence of Episode
        The drive, at the model's period.
    """
    starts, past, commands, ends = _windows(model, episodes)
    none = (0.0, 0.0, 0.0)
    if len(starts) < FEWEST:
        return Comparison(ModelVerdict.SHORT, len(starts), none, none)
    nominal = nominal_unicycle(model.dt)
    with np.errstate(over="ignore", invalid="ignore"):  # a model may diverge: it is worse then
        predicted = model.rollout(starts, commands, past if model.history else None)[:, -1]
        plain = nominal.rollout(starts, commands)[:, -1]
        ours, theirs, apart = (
            seen_along(d, starts[:, 2]) for d in (predicted - ends, plain - ends, predicted - plain)
        )
        rms = [np.sqrt(np.mean(e**2, axis=0)) for e in (ours, theirs, apart)]
    found = (len(starts), as_triple(rms[0]), as_triple(rms[1]))
    if not np.isfinite(rms[0]).all():
        return Comparison(ModelVerdict.WORSE, *found)
    # of each window and direction a share, so that a few large errors do not decide alone
    worse = (ours**2 - theirs**2) / np.maximum(ours**2 + theirs**2, 1e-18)
    mean = worse.mean(axis=0)
    least = SURE * worse.std(axis=0, ddof=1) / np.sqrt(len(worse))
    is_worse = bool(np.any((mean > least) & (rms[0] > rms[1])))
    if np.any((mean < -least) & (rms[0] < rms[1])) and not is_worse:
        return Comparison(ModelVerdict.BETTER, *found)
    if bool(np.all(rms[2] <= ALIKE * np.minimum(rms[0], rms[1]) + 1e-9)):
        return Comparison(ModelVerdict.ALIKE, *found)
    return Comparison(ModelVerdict.WORSE if is_worse else ModelVerdict.UNSURE, *found)


def _windows(model: KoopmanModel, episodes: Sequence[Episode]) -> tuple[Array, Array, Array, Array]:
    """First poses (n, 3), commands before (n, L, 2), commands (n, T, 2) and last poses (n, 3)."""
    steps, history = max(1, round(HORIZON / model.dt)), model.history
    inputs = [np.abs(e.inputs).max(axis=0) for e in episodes]
    largest = np.maximum(np.max(inputs, axis=0), 1e-9) if inputs else np.ones(2)
    found: list[tuple[Array, Array, Array, Array]] = []
    for e in episodes:
        for k in range(history, len(e) - steps + 1, steps):
            held = e.inputs[k : k + steps]
            if float((np.abs(held).mean(axis=0) / largest).max()) > MOVING:
                before = e.inputs[k - history : k]
                found.append((e.states[k], before, held, e.states[k + steps]))
    if not found:
        empty = np.zeros((0, STATES))
        return empty, empty, empty, empty
    starts, past, commands, ends = (np.array(part) for part in zip(*found, strict=True))
    return starts, past, commands, ends
