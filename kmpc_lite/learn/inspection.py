"""What a log holds, in lines that a user reads before learning from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.checklist import judge
from kmpc_lite.learn.checks.drives import refuse_car_like
from kmpc_lite.learn.checks.poses import tell_poses
from kmpc_lite.learn.checks.relations import tell_delay
from kmpc_lite.learn.cutting import cut, model_period
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.formats.readers import read_log
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found in one log."""

    name: str
    log: Log
    topics: tuple[Topic, ...]
    lines: tuple[tuple[str, str], ...]
    """What it is about, and what there is to say."""
    notes: tuple[str, ...]
    suspects: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """All of it as values that JSON can hold."""
        return {
            "log": self.name,
            "topics": [topic._asdict() for topic in self.topics],
            **dict(self.lines),
            "notes": list(self.notes),
            "suspects": list(self.suspects),
        }


def inspect(file: Path, how: ReadOptions | None = None) -> Findings:
    """Read a log and look at it.

    Raises
    ------
    DataError
        Where it cannot be read.
    """
    log, suspects = _read(file, ReadOptions() if how is None else how)
    verdict = judge(log)
    suspects += [suspect.reason for suspect in verdict.suspects]
    notes = list(log.notes)
    try:
        data = Dataset(cut(log, model_period(log)))
        drives = f"{data}; the longest {max(map(len, data.episodes)) * data.dt:.1f} s"
    except DataError as error:
        drives = "none"
        if not suspects:
            suspects.append(str(error).removeprefix(f"{log.name}: "))
    else:
        suspects += _find_car(data)
        notes += tell_poses(log, data.dt)
    lines = (
        ("poses", _describe(log.poses, ("x", "y", "theta"), ("m", "m", "rad"))),
        ("commands", _describe(log.commands, ("v", "omega"), ("m/s", "rad/s"))),
        ("drives", drives),
        ("delay", _tell_delay(verdict.delay, log)),
    )
    return Findings(str(file), log, log.topics, lines, tuple(notes), tuple(suspects))


def _read(file: Path, how: ReadOptions) -> tuple[Log, list[str]]:
    """Read a log, also one whose time runs back, and say that it does."""
    try:
        return read_log(file, how), []
    except DataError as error:
        try:
            log = read_log(file, replace(how, force=True))
        except DataError:
            raise error from None
        return log, [str(error).removeprefix(f"{file}: ")]


def _find_car(data: Dataset) -> list[str]:
    """Say where the robot does not turn on the spot though it is told to."""
    try:
        refuse_car_like(data)
    except DataError as error:
        return [str(error)]
    return []


def _describe(series: Series, names: tuple[str, ...], units: tuple[str, ...]) -> str:
    """Samples, rate, span and ranges of a series."""
    steps = np.diff(series.time)
    growing = steps[steps > 0.0]
    rate = f" at {1.0 / np.median(growing):.3g} Hz" if len(growing) else ""
    span = float(series.time.max() - series.time.min())
    ranges = ", ".join(
        f"{name} {low:.3g} to {high:.3g} {unit}"
        for name, unit, low, high in zip(
            names, units, series.values.min(axis=0), series.values.max(axis=0), strict=True
        )
    )
    return f"{len(series.time)}{rate} over {span:.1f} s: {ranges}"


def _tell_delay(delay: float | None, log: Log) -> str:
    """How long after its command the motion comes [s], in words."""
    if delay is None:
        return "not known: the commands hardly change, or explain too little of the motion"
    return f"the motion comes {tell_delay(delay, model_period(log))}"
