"""How well a model predicts driving that it has not seen, and whether better than nominal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import SAME_DT
from kmpc_lite.geometry import seen_along
from kmpc_lite.learn.dataset import Dataset, Episode, check_time
from kmpc_lite.learn.ramps import let_through
from kmpc_lite.model.file import Ramps
from kmpc_lite.model.koopman import KoopmanModel, nominal_like
from kmpc_lite.types import Array

Errors = tuple[float, float, float]
"""Along [m], across [m] and of the heading [rad], root mean square."""


@dataclass(frozen=True)
class FitReport:
    """Held-out RMS errors one period and `horizon` [s] ahead of `starts` poses: ours, nominal."""

    horizon: float  # how far ahead the many-step errors look [s]
    starts: int  # from how many poses
    one_step: Errors
    """Longitudinal [m], lateral [m], heading [rad], one period ahead; in the frame of the true
    starting pose."""
    multi_step: Errors  # the same after `horizon`
    nominal_one_step: Errors  # of the nominal unicycle, one period ahead
    nominal_multi_step: Errors
    """The nominal unicycle after `horizon`."""
    rmse_percent: float
    """The paper's ``100 sqrt(mean |x - xhat|^2)`` of one period."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """Render as a table."""
        rows = (
            ("one step", "model", self.one_step),
            ("one step", "nominal unicycle", self.nominal_one_step),
            (f"{self.horizon:g} s", "model", self.multi_step),
            (f"{self.horizon:g} s", "nominal unicycle", self.nominal_multi_step),
        )
        lines = [
            f"held-out RMS error from {self.starts} starts   "
            "longitudinal [m]  lateral [m]  heading [rad]"
        ]
        lines += [
            f"  {ahead:<9} {who:<32}{e[0]:>14.4g}{e[1]:>13.4g}{e[2]:>15.4g}"
            for ahead, who, e in rows
        ]
        lines.append(f"  paper's RMSE of one step: {self.rmse_percent:.2f} %")
        return "\n".join(lines)


def evaluate(
    model: KoopmanModel, dataset: Dataset, horizon: float = 1.0, stride: int = 1
) -> FitReport:
    """Open-loop prediction errors from true poses, against the nominal unicycle.

    Parameters
    ----------
    model : KoopmanModel
        What is judged.
    dataset : Dataset
        Episodes that the model has not seen, at the model's dt.
    horizon : float
        How far to predict [s]; rounded to whole periods.
    stride : int
        Every how many samples a prediction starts.

    Raises
    ------
    DataError
        For another dt, an impossible horizon or stride, or if no episode is long enough.
    """
    if abs(dataset.dt - model.dt) > SAME_DT * model.dt:
        raise DataError(
            f"the dataset's dt is {dataset.dt:g} s, the model's {model.dt:g} s: resample it"
        )
    if stride != int(stride) or stride < 1:
        raise DataError(f"stride: expected a whole number >= 1, got {stride}")
    steps = max(1, int(round(check_time("horizon", horizon) / model.dt)))
    one, many = (_errors(model, dataset, length, int(stride)) for length in (1, steps))
    if not many.starts:
        longest = max(len(e) for e in dataset.episodes) * dataset.dt
        raise DataError(
            f"no held-out episode is as long as {horizon:g} s "
            f"plus an input history of {model.history} steps (longest {longest:g} s)"
        )
    ahead, paper = steps * model.dt, 100 * one.state
    return FitReport(ahead, many.starts, one.model, many.model, one.nominal, many.nominal, paper)


class _Found(NamedTuple):
    """Errors after some steps."""

    model: Errors
    nominal: Errors
    state: float  # of the model, over all three together
    starts: int


def _errors(model: KoopmanModel, dataset: Dataset, steps: int, stride: int) -> _Found:
    """Errors of a model, and of the nominal robot, after some steps from each start."""
    nominal, passed = nominal_like(model), let_through(dataset, Ramps.of(model.info))
    sums, count = np.zeros((3, 3)), 0
    # a model may diverge far from its data: then its error is infinite, and no warning is due
    with np.errstate(over="ignore", invalid="ignore"):
        for told, driven in zip(
            dataset.pieces(steps, model.history, stride),
            passed.pieces(steps, model.history, stride),
            strict=True,
        ):
            start, end = told.states[:, 0], told.states[:, -1]
            ours = model.rollout(start, driven.inputs, driven.before)[:, -1] - end
            theirs = nominal.rollout(start, told.inputs)[:, -1] - end
            seen = seen_along(ours, start[:, 2]), seen_along(theirs, start[:, 2]), ours
            sums += np.array([np.sum(error**2, axis=0) for error in seen])
            count += len(start)
        means = np.where(np.isnan(sums), np.inf, sums) / max(count, 1)
        rms = np.sqrt(means)
    return _Found(_triple(rms[0]), _triple(rms[1]), float(np.sqrt(means[2].sum())), count)


def _triple(errors: Array) -> Errors:
    """Errors (3,) as plain numbers."""
    along, across, heading = errors.tolist()
    return along, across, heading


class ModelVerdict(Enum):
    """What a comparison says."""

    BETTER = "predicts better than the nominal robot"
    WORSE = "predicts worse than the nominal robot"
    ALIKE = "predicts as the nominal robot does, and nothing hangs on the difference"
    UNSURE = "does not predict better than the nominal robot beyond noise"
    SHORT = "was driven too little to tell"


HORIZON, FEWEST = 1.0, 10
"""How far ahead is predicted [s], in windows that do not overlap; windows of driving from which on
there is a verdict."""
SURE = 3.0
"""Standard errors by which one must predict better, in one direction at least, while the other
does so in none."""
ALIKE, MOVING = 0.3, 0.1
"""Predictions that differ by less than this share of what both err are alike; share of the largest
commands below which a window counts as standing."""


@dataclass(frozen=True)
class Comparison:
    """Errors of a model and of the nominal robot over the same windows."""

    verdict: ModelVerdict
    windows: int
    errors: Errors = (0.0, 0.0, 0.0)
    nominal: Errors = (0.0, 0.0, 0.0)  # of the nominal robot

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

    `model`: what was learned, not from this drive. `episodes`: the drive, at the model's period.
    """
    if not episodes:
        return Comparison(ModelVerdict.SHORT, 0)
    steps, drives = max(1, round(HORIZON / model.dt)), Dataset(episodes)
    states, before, inputs = drives.every_piece(steps, model.history, stride=steps)
    largest = np.maximum(np.abs(drives.inputs).max(axis=0), 1e-9)
    moving = (np.abs(inputs).mean(axis=1) / largest).max(axis=1) > MOVING
    starts, ends, inputs = states[moving, 0], states[moving, -1], inputs[moving]
    if len(starts) < FEWEST:
        return Comparison(ModelVerdict.SHORT, len(starts))
    with np.errstate(over="ignore", invalid="ignore"):  # a model may diverge: it is worse then
        past = before[moving] if model.history else None
        predicted = model.rollout(starts, inputs, past)[:, -1]
        plain = nominal_like(model).rollout(starts, inputs)[:, -1]
        ours, theirs, apart = (
            seen_along(d, starts[:, 2]) for d in (predicted - ends, plain - ends, predicted - plain)
        )
        own, nominal, between = (np.sqrt(np.mean(e**2, axis=0)) for e in (ours, theirs, apart))
    # of each window and direction a share, so that a few large errors do not decide alone
    worse = (ours**2 - theirs**2) / np.maximum(ours**2 + theirs**2, 1e-18)
    mean, least = worse.mean(axis=0), SURE * worse.std(axis=0, ddof=1) / np.sqrt(len(worse))
    diverges = not np.isfinite(own).all()
    is_worse = diverges or bool(np.any((mean > least) & (own > nominal)))
    found = ModelVerdict.WORSE if is_worse else ModelVerdict.UNSURE
    if not is_worse and np.any((mean < -least) & (own < nominal)):
        found = ModelVerdict.BETTER
    elif not diverges and bool(np.all(between <= ALIKE * np.minimum(own, nominal) + 1e-9)):
        found = ModelVerdict.ALIKE
    return Comparison(found, len(starts), _triple(own), _triple(nominal))
