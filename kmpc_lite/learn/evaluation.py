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
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_like
from kmpc_lite.model.ramps import Ramps
from kmpc_lite.types import INPUTS, STATES, Array


@dataclass(frozen=True)
class FitReport:
    """Held-out prediction errors, root mean square, of a model and of the nominal unicycle."""

    horizon: float
    """How far ahead the many-step errors look [s]."""
    starts: int
    """From how many poses."""
    one_step: tuple[float, float, float]
    """Longitudinal [m], lateral [m], heading [rad], one period ahead; in the frame of the true
    starting pose."""
    multi_step: tuple[float, float, float]
    """The same after `horizon`."""
    nominal_one_step: tuple[float, float, float]
    """The nominal unicycle, one period ahead."""
    nominal_multi_step: tuple[float, float, float]
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
    stride, steps = int(stride), max(1, int(round(check_time("horizon", horizon) / model.dt)))
    sums = [_squared_errors(model, dataset, length, stride) for length in (1, steps)]
    if not sums[1].starts:
        longest = max(len(e) for e in dataset.episodes) * dataset.dt
        raise DataError(
            f"no held-out episode is as long as {horizon:g} s "
            f"plus an input history of {model.history} steps (longest {longest:g} s)"
        )
    one, many = sums
    return FitReport(
        steps * model.dt,
        many.starts,
        as_triple(one.model),
        as_triple(many.model),
        as_triple(one.nominal),
        as_triple(many.nominal),
        100 * one.state,
    )


class _Errors(NamedTuple):
    """Root mean squares of errors after some steps."""

    model: Array
    """Along, across, heading, (3,)."""
    nominal: Array
    state: float
    """Of the model, over all three together."""
    starts: int


def _squared_errors(model: KoopmanModel, dataset: Dataset, steps: int, stride: int) -> _Errors:
    """Errors of a model, and of the nominal robot, after some steps from each start."""
    nominal, passed = nominal_like(model), let_through(dataset, Ramps.of(model.info))
    sums, total, count = np.zeros((2, 3)), 0.0, 0
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
            for sum_, error in zip(sums, (ours, theirs), strict=True):
                sum_ += np.sum(seen_along(error, start[:, 2]) ** 2, axis=0)
            total += float(np.sum(ours**2))
            count += len(start)
    most = max(count, 1)
    ours, theirs = np.sqrt(np.where(np.isnan(sums), np.inf, sums) / most)
    return _Errors(
        ours, theirs, float(np.sqrt((np.inf if np.isnan(total) else total) / most)), count
    )


def as_triple(errors: Array) -> tuple[float, float, float]:
    """Errors (3,) along [m], across [m] and of the heading [rad] as plain numbers."""
    along, across, heading = errors.tolist()
    return along, across, heading


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
    starts, past, commands, ends = _driven(model, episodes)
    none = (0.0, 0.0, 0.0)
    if len(starts) < FEWEST:
        return Comparison(ModelVerdict.SHORT, len(starts), none, none)
    nominal = nominal_like(model)
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


def _driven(model: KoopmanModel, episodes: Sequence[Episode]) -> tuple[Array, Array, Array, Array]:
    """First poses (n, 3), commands before (n, L, 2), commands (n, T, 2) and last poses (n, 3)."""
    steps, history = max(1, round(HORIZON / model.dt)), model.history
    if not episodes:
        return np.zeros((0, STATES)), *np.zeros((2, 0, 1, INPUTS)), np.zeros((0, STATES))
    drives = Dataset(episodes)
    largest = np.maximum(np.max([np.abs(e.inputs).max(axis=0) for e in episodes], axis=0), 1e-9)
    states, before, inputs = drives.every_piece(steps, history, stride=steps)
    moving = (np.abs(inputs).mean(axis=1) / largest).max(axis=1) > MOVING
    return states[moving, 0], before[moving], inputs[moving], states[moving, -1]
