"""From a log to a model to drive with: fitted, checked on the rest of the log, calibrated.

What a model file says of its making (which vehicle, how fast, how it stops) `kmpc run` reads before
the first drive with the model.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, isclose
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import with_noise, with_quantiles
from kmpc_lite.learn.coverage import measure_stopping
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.evaluation import FitReport, evaluate
from kmpc_lite.learn.fitting import Lags, fit, refuse_car_like
from kmpc_lite.learn.formats.readers import find_logs
from kmpc_lite.learn.ramps import find_ramps, let_through, with_ramps
from kmpc_lite.learn.regression import Method
from kmpc_lite.learn.selection import ACROSS, ALONG, HEADING, NAMES, NOMINAL, learned_axes
from kmpc_lite.learn.verdict import BETTER, DIRECTIONS, WORSE, describe_fit, find_gains, times
from kmpc_lite.model.dictionary import (
    Dictionary,
    HermiteTrigDictionary,
    dictionary_from_config,
    dictionary_to_config,
)
from kmpc_lite.model.file import Ramps, is_vehicle
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.reading import text_lines
from kmpc_lite.types import INPUTS, STATES

GAINS = (0.1, 10.0)
"""Between which the gains of robots lie, sluggish ones and those commanded by shares among them."""
SURE = 2.0
"""Standard errors by which a direction must be worse than the nominal robot's to stay nominal."""
FEWEST_EPISODES, WINDOW, WINDOW_STEPS = 10, 5.0, 50
"""A log of fewer episodes is cut into windows before it is split: so long [s], or so many periods
if that is longer."""


@dataclass(frozen=True)
class LearningOptions:
    """How a model is learned from a log and checked: the defaults are those of `kmpc fit`."""

    dictionary: Dictionary = HermiteTrigDictionary(order=0)
    """How the pose is lifted; the default is the same wherever the robot is."""
    method: Method = "integral"
    symmetric: bool | None = None
    lags: Lags = "auto"  # these three as `fit` takes them
    holdout: float = 0.5  # share of the episodes that is kept for the check
    horizon: float = 1.0  # how far ahead the check looks [s]
    seed: int = 0  # of the split


@dataclass(frozen=True, eq=False)
class Learned:
    """A model, and what is known of it."""

    model: KoopmanModel
    """Its `info` holds the held-out errors, what it was made of and its margins' quantiles."""
    train: Dataset  # what it was learned from
    held: Dataset  # what it was checked and calibrated on
    report: FitReport  # its errors on what was held out
    made: Mapping[str, Any]  # from which logs, of which vehicle; see `describe_making`
    uncalibrated: str  # why its margins are not calibrated; empty where they are
    facts: Mapping[str, Any]
    """What was found out about the robot; empty if no lags were given or looked for."""


def learn(
    data: Dataset,
    logs: Sequence[Path],
    options: LearningOptions | None = None,
    vehicle: Mapping[str, Any] | None = None,
    shape: Mapping[str, Any] | None = None,
) -> Learned:
    """Learn a model from a part of a log, check and calibrate it on the rest.

    `data`: the whole log, as `load_logs` gives it. `logs`: the files that it was read from.
    `options`: how. `vehicle`: what the logs, or the user, say of the vehicle; see `read_vehicle`.
    `shape`: what the user says of its size: `radius` [m], or `footprint`, its corners. Raises
    DataError if the log is too short to split, or cannot determine a model.
    """
    options = LearningOptions() if options is None else options
    # before the log is cut: a piece does not tell how fast the robot drives where it begins, and
    # half of the turns on the spot may be too few to tell
    log, ramps = data, Ramps.of({})
    if options.lags:
        refuse_car_like(data)
        ramps = find_ramps(data)
    data = let_through(log, ramps)
    train, held = split_log(data, logs, options.holdout, options.seed)
    dictionary = options.dictionary
    if dictionary.commands != data.commands:
        config = {**dictionary_to_config(dictionary), "commands": data.commands}
        dictionary = dictionary_from_config(config)
    fitted = partial(
        fit,
        train,
        dictionary,
        options.method,
        symmetric=options.symmetric,
        lags=options.lags,
        ramps=False,
        whole=data,
    )
    model = fitted()
    report = evaluate(model, held, options.horizon)
    stays: dict[int, str] = {}
    while "selection" in model.info and (worse := _worst(model, held, report, stays)):
        stays |= worse
        model = fitted(stay=stays)
        report = evaluate(model, held, options.horizon)
    facts: dict[str, Any] = {}
    if "selection" in model.info:
        facts = describe_fit(model, train, data, report)
        facts["stays_nominal"] = [stays[which] for which in sorted(stays)]
        facts["braking_distance"] += float(facts["largest"]["v"] ** 2 / (2.0 * ramps.slower[0]))
    uncalibrated = ""
    try:
        model = with_quantiles(model, held)
    except DataError as error:
        uncalibrated = str(error)
        if facts and learned_axes(model).any():
            model = with_noise(model, data)  # what calibrates nothing tells of the noise, too
        elif facts:  # what lags and slips it has not shown would be taken for noise
            model = replace(model, noise_model=None)
    if options.lags:
        model = with_ramps(model, log, ramps)
    limits = {name: model.info[name] for name in ("ramps", "changes") if name in model.info}
    made = {**describe_making(model, logs, data, vehicle=vehicle), **limits, **(shape or {})}
    model = replace(model, info={**model.info, "held_out": report.as_dict(), **made})
    return Learned(model, train, held, report, made, uncalibrated, facts)


def _worst(
    model: KoopmanModel, held: Dataset, report: FitReport, stays: Collection[int]
) -> dict[int, str]:
    """Direction in which a model is worse than the nominal robot beyond chance, the worst first.

    One whose gains no robot has is the worst. Else it is asked of each held-out piece, and what is
    lost in all of them is compared with how much it varies. A turn that is wrong leads astray along
    and across, too: the heading goes first.
    """
    pieces = []
    for episode in held.episodes:
        try:
            pieces.append(evaluate(model, Dataset([episode]), report.horizon))
        except DataError:
            continue  # shorter than what is predicted
    ours, theirs = (
        np.array([getattr(p, name) for p in pieces]).reshape(-1, STATES) ** 2
        for name in ("multi_step", "nominal_multi_step")
    )
    lost = ours - theirs
    error = lost.std(axis=0, ddof=1) / np.sqrt(len(lost)) if len(lost) > 1 else np.zeros(STATES)
    known = find_gains(model, held)
    gains = {HEADING: known["turn_gain"], ALONG: known["speed_gain"]}
    for which in (HEADING, ALONG, ACROSS):
        gain, told = gains.get(which, 1.0), DIRECTIONS[which]
        if which in stays:
            continue
        if not GAINS[0] < gain < GAINS[1]:
            how = f"a gain of {gain:.3g} fits, which no robot has: the log does not tell it"
            return {which: f"{told} ({how})"}
        ratio = report.multi_step[which] / max(report.nominal_multi_step[which], 1e-12)
        by_little = ratio <= BETTER and not lost.mean(axis=0)[which] > SURE * error[which]
        step = model.info["selection"]["directions"][NAMES[which]]["step"]
        if ratio > WORSE and not by_little and step != NOMINAL:
            return {which: f"{told} ({times(ratio)} times worse on held-out rows as fitted)"}
    return {}


def split_log(
    data: Dataset, logs: Sequence[Path], holdout: float, seed: int
) -> tuple[Dataset, Dataset]:
    """Split a log into what is learned from, and the share of its episodes that is checked on.

    One of few episodes is cut into windows before.

    Raises DataError if it is too short; names its files.
    """
    if len(data) < FEWEST_EPISODES:
        data = data.windows(max(WINDOW, WINDOW_STEPS * data.dt))
    if len(data) < 2:
        where = ", ".join(map(str, logs))
        raise DataError(
            f"{where}: {data.steps * data.dt:g} s of driving are too few to learn from a part "
            "and check the other"
        )
    return data.split(1.0 - holdout, seed=seed)


REMARK, LONGEST = "# vehicle ", 4096
"""What a log's first line begins with where its recorder knew the vehicle, JSON follows; characters
of the longest such line."""
ROLLS = 1e-3  # speed below which a command tells no curvature [m/s]
SHOWN = 0.5  # a speed counts as driven where the log holds it, or more, for so long [s]


def describe_making(
    model: KoopmanModel,
    logs: Sequence[Path],
    data: Dataset,
    vehicle: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Values for a model's `info`, which JSON can hold.

    `model`: what was learned. `logs`: from which files. `data`: the whole log, with what the model
    was checked on. `vehicle`: what the log, or the user, says of the vehicle.
    """
    made: dict[str, Any] = {
        "log": [str(file) for file in logs],
        "driven": driven_speeds(data),
        "stopping": measure_stopping(model, data).as_dict(),
        "wheels": describe_wheels(data),
    }
    more = {"steered": data.steered, "geometry": data.geometry, "vehicle": dict(vehicle or {})}
    return {**made, **{name: value for name, value in more.items() if value}}


def describe_wheels(data: Dataset) -> dict[str, Any]:
    """Kind of the wheels that a log is of, as `read_wheels` takes it; a car's sharpest turn."""
    if data.commands > INPUTS:
        return {"kind": "omni"}
    if not data.steered:
        return {"kind": "differential"}
    v, omega = data.inputs[np.abs(data.inputs[:, 0]) > ROLLS].T
    sharpest = float(np.max(np.abs(omega / v), initial=0.0))
    radius = {"turning_radius": round(1.0 / sharpest, 6)} if sharpest > 0.0 else {}
    return {"kind": "car", **radius}


def driven_speeds(data: Dataset) -> dict[str, float]:
    """Largest speeds forward and back [m/s] and turn rate [rad/s] that a log shows for a while.

    Of an omni to its sides, too.
    """
    rows = min(data.steps, max(1, ceil(SHOWN / data.dt)))
    v, *aside, omega = data.inputs.T
    shown = {"forward": v, "reverse": -v, "turn": np.abs(omega)}
    if aside:
        shown["sideways"] = np.abs(aside[0])
    return {name: max(0.0, float(np.sort(values)[-rows])) for name, values in shown.items()}


def read_vehicle(files: Sequence[Path], name: str | None = None) -> dict[str, Any] | None:
    """What logs say of their vehicle; None if none of them says anything.

    `files`: logs of any kind, and folders; tables of text may begin with a remark on the vehicle.
    `name`: name of the vehicle, which goes before the logs' own. Raises DataError if two logs are
    of different vehicles.
    """
    found: dict[str, Any] = {}
    first = None
    for file in find_logs(files):
        if (said := _remark(file)) is None:
            continue
        if first is not None and (different := differences(found, said)):
            raise DataError(
                f"{file}: of another vehicle than {first}: {'; '.join(different)}; one model is "
                "learned from logs of one vehicle"
            )
        first, found = first or file, {**said, **found}
    return {**found, **({} if name is None else {"name": name})} or None


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """What differs between two vehicles, in words; what only one of them says does not count."""
    both = [(key, one[key], other[key]) for key in one if key in other]
    return [f"{key} {a} and {b}" for key, a, b in both if a != b and not _near(a, b)]


def _near(*values: Any) -> bool:
    """Whether two values are numbers that are the same to a thousandth."""
    return all(isinstance(v, int | float) for v in values) and isclose(*values, rel_tol=1e-3)


def _remark(file: Path) -> dict[str, Any] | None:
    """The remark at the beginning of a table of text, if there is one."""
    if file.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return None
    with closing(text_lines(file, LONGEST)) as lines:
        try:
            first = next(lines, "")
        except (OSError, ValueError):  # whoever reads the log says what is wrong with it
            return None
    if not first.startswith(REMARK):
        return None
    try:
        said = json.loads(first.removeprefix(REMARK))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{file}: line 1: the remark on the vehicle is no JSON: {error}") from error
    if not is_vehicle(said):
        raise DataError(f"{file}: line 1: the remark on the vehicle is no table of plain values")
    return dict(said)
