"""From files to a dataset: read, checked, cut, each file in its turn; or only looked at.

What is remarkable in poses is reported though the log is learned from: jumps, stand-stills, and
that they come seldom. A pose that is repeated to the last digit while the robot is commanded to
move is no new one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks import LogVerdict, judge, refuse_late, tell_delay
from kmpc_lite.learn.cutting import GAP, asked_of, cut, even_stamps, jumps_of, model_period
from kmpc_lite.learn.dataset import Dataset, Episode, check_time
from kmpc_lite.learn.fitting import refuse_car_like
from kmpc_lite.learn.formats.readers import find_logs, read_log, refuse_unused
from kmpc_lite.learn.logs import Log, ReadOptions, Series
from kmpc_lite.types import Array

SAMPLES_PER_PERIOD = 20.0  # samples of a stream that are kept within one of the model's periods
STANDING = 0.1  # share of the largest command below which a robot may stand
LATE = 1.5  # periods of a model that may pass between two new poses of a moving robot
LOST = 3.0  # time for which a robot is commanded to move while its pose stands still [s]


def load_logs(
    paths: Sequence[Path],
    dt: float | None = None,
    gap: float | None = None,
    how: ReadOptions | None = None,
    tell: Callable[[str], None] | None = None,
) -> Dataset:
    """Read logs of one robot at one period, and refuse what is suspect.

    `paths`: files and folders, of any format. `dt`: period [s]; 0.1, or the first log's own if
    longer, if not given. `gap`: a longer time between poses ends an episode [s]. `how`: how the
    logs are to be read; with ``force`` suspects are reported instead of refused. `tell`: takes
    lines about what each log is. Raises DataError for whatever is wrong, or suspect; where a log is
    given twice.
    """
    how, tell = how or ReadOptions(), tell or (lambda line: None)
    gap = None if gap is None else check_time("gap", gap)
    parts: list[tuple[list[Episode], Mapping[str, float]]] = []
    for log, verdict in read_files(paths, how, dt):
        dt = model_period(log) if dt is None else dt
        if verdict.delay is not None and not how.force:
            refuse_late(log.name, verdict.delay, dt)
        parts.append((cut(log, dt, gap), log.geometry))
        late = () if verdict.delay is None else (f"motion {tell_delay(verdict.delay, dt)}",)
        forced = (f"suspect, and forced: {reason}" for reason in verdict.suspects)
        for line in (*log.notes, *verdict.notes, *late, *tell_poses(log, dt), *forced):
            tell(f"{log.name}: {line}")
    return _of_one_robot(parts, tell)


def read_files(
    paths: Sequence[Path], how: ReadOptions, dt: float | None
) -> Iterator[tuple[Log, LogVerdict]]:
    """Read logs one after another; refuse what is suspect, options for none, a file given twice."""
    dt, files, seen = None if dt is None else check_time("dt", dt), find_logs(paths), set[Path]()
    refuse_unused(files, how)
    for file in files:
        if file.resolve() in seen:
            raise DataError(
                f"{file}: given twice: what is learned from would be checked against itself"
            )
        seen.add(file.resolve())
        yield read_checked(file, how, dt)


def read_checked(file: Path, how: ReadOptions, dt: float | None) -> tuple[Log, LogVerdict]:
    """Read one log as closely as a period [s] needs, and refuse what is suspect in it.

    Raises DataError if it cannot be read, or is suspect and not forced.
    """
    if dt is not None:
        how = replace(how, spacing=dt / SAMPLES_PER_PERIOD)
    log = read_log(file, how)
    verdict = judge(log)
    if not how.force:
        verdict.refuse(log)
    return even_stamps(log), verdict


def _of_one_robot(
    parts: Sequence[tuple[list[Episode], Mapping[str, float]]], tell: Callable[[str], None]
) -> Dataset:
    """Put drives of one robot together: a car has one wheelbase, the median of its logs'."""
    every = [e for episodes, _ in parts for e in episodes]
    bases = np.array([told.get("wheelbase", np.nan) for _, told in parts])
    if len(parts) == 1 or np.isnan(bases).any():
        return Dataset(every, parts[0][1])
    order = np.argsort(bases)
    steps = np.array([sum(map(len, episodes)) for episodes, _ in parts])[order]
    one = float(bases[order][np.searchsorted(np.cumsum(steps), 0.5 * steps.sum())])
    if np.ptp(bases) > 0.1 * abs(one):
        tell(
            f"the logs tell wheelbases of {abs(bases).min():.2f} to {abs(bases).max():.2f} m: "
            f"{abs(one):.2f} m is taken for all; --wheelbase M says which"
        )
    scaled = [
        replace(e, inputs=e.inputs * (1.0, base / one))
        for (episodes, _), base in zip(parts, bases, strict=True)
        for e in episodes
    ]
    return Dataset(scaled, {"wheelbase": one})


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found in one log."""

    log: Log
    lines: dict[str, str]  # what there is to say, by what it is about
    notes: list[str]
    suspects: list[str]
    doubts: tuple[str, ...]  # what is doubtful of the delay

    def as_dict(self) -> dict[str, Any]:
        """All of it as values that JSON can hold."""
        return {
            "log": self.log.name,
            "topics": [topic._asdict() for topic in self.log.topics],
            **self.lines,
            "notes": [*self.notes, *self.doubts],
            "suspects": self.suspects,
        }


def inspect(file: Path, how: ReadOptions | None = None) -> Findings:
    """Read a log and look at it, also one whose time runs back.

    Raises DataError if it cannot be read.
    """
    how, suspects = how or ReadOptions(), list[str]()
    try:
        log = read_log(file, how)
    except DataError as error:
        try:
            log = read_log(file, replace(how, force=True))
        except DataError:
            raise error from None
        suspects.append(str(error).removeprefix(f"{file}: "))
    verdict, log = judge(log), even_stamps(log)
    suspects += verdict.suspects
    notes, drives = list(log.notes), "none"
    try:
        data = Dataset(cut(log, model_period(log)))
        drives = f"{data}; the longest {max(map(len, data.episodes)) * data.dt:.1f} s"
        notes += tell_poses(log, data.dt)
        refuse_car_like(data)
    except DataError as error:
        if not suspects or drives != "none":
            suspects.append(str(error).removeprefix(f"{log.name}: "))
    delay = "not known: the commands hardly change, or explain too little of the motion"
    if verdict.delay is not None:
        delay = f"the motion {tell_delay(verdict.delay, model_period(log))}"
    units = (*("m/s" for _ in log.columns[1:]), "rad/s")
    lines = {
        "poses": _describe(log.poses, ("x", "y", "theta"), ("m", "m", "rad")),
        "commands": _describe(log.commands, log.columns, units),
        "drives": drives,
        "delay": delay,
    }
    return Findings(log, lines, notes, suspects, verdict.notes)


def _describe(series: Series, names: tuple[str, ...], units: tuple[str, ...]) -> str:
    """Samples, rate, span and ranges of a series."""
    steps = np.diff(series.time)
    growing = steps[steps > 0.0]
    rate = f" at {1.0 / np.median(growing):.3g} Hz" if len(growing) else ""
    ends = zip(names, units, series.values.min(axis=0), series.values.max(axis=0), strict=True)
    ranges = ", ".join(f"{name} {low:.3g} to {high:.3g} {unit}" for name, unit, low, high in ends)
    return f"{len(series.time)}{rate} over {np.ptp(series.time):.1f} s: {ranges}"


def tell_poses(log: Log, dt: float) -> list[str]:
    """What is remarkable in the poses for a model's period [s], one line each."""
    time, poses = log.poses.time, log.poses.values
    new = np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])
    rows = np.flatnonzero(new)
    if len(rows) < 20:
        return []
    told = _tell_repeats(log, dt, rows, asked_of(log))
    for name, sizes in jumps_of(log).items():
        k, unit = int(np.argmax(sizes)), "m" if name == "position" else "rad"
        told.append(
            f"{log.where(k + 1)}: the {name} jumps by {sizes[k]:.3g} {unit} in "
            f"{time[k + 1] - time[k]:.2g} s ({np.count_nonzero(sizes)} such jumps), far more than "
            "was asked: the log is cut there"
        )
    return told


def _tell_repeats(log: Log, dt: float, rows: Array, asked: Array) -> list[str]:
    """Lines on poses that come seldom, or not at all for a while, though the robot should move."""
    time = log.poses.time
    moving = np.any(asked > STANDING * asked.max(axis=0), axis=1)
    still = np.concatenate([[0], np.cumsum(~moving)])
    steps = np.diff(time[rows])
    driven = (still[rows[1:]] == still[rows[:-1]]) & (steps > 0.0)
    if driven.sum() < 20:
        return []
    every = float(np.median(steps[driven]))
    period = float(np.median(np.diff(time)))
    if np.diff(rows)[driven].max() > 1 and every > LATE * dt:
        return [
            f"poses of the moving robot change every {every:.2g} s only, though logged every "
            f"{period:.2g} s: what lies between is old, and learned as lateness; --dt {every:.2g}"
        ]
    held = np.clip(np.diff(time), 0.0, GAP * period) * moving[:-1]
    told = np.diff(np.concatenate([[0.0], np.cumsum(held)])[rows])
    lost = (np.diff(rows) > 1) & (told > LOST)
    if not lost.any():
        return []
    longest = int(np.argmax(told * lost))
    return [
        f"{log.where(int(rows[longest]))}: the pose does not change for {steps[longest]:.3g} s, in "
        f"which the robot is commanded to move ({int(lost.sum())} such): blocked, or its pose was "
        "lost; cut that out"
    ]
