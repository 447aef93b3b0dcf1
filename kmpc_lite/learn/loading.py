"""From files to a dataset that may be learned from: read, checked, cut, each file in its turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from kmpc_lite.errors import DataError
from kmpc_lite.learn.checks.checklist import LogVerdict, judge
from kmpc_lite.learn.checks.poses import tell_poses
from kmpc_lite.learn.checks.relations import refuse_late, tell_delay
from kmpc_lite.learn.cutting import cut, model_period
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.episode import check_time
from kmpc_lite.learn.formats.readers import find_logs, read_log, refuse_unused
from kmpc_lite.learn.logs import Log, ReadOptions

SAMPLES_PER_PERIOD = 20.0
"""Samples of a stream that are kept within one of the model's periods."""


def load_logs(
    paths: Sequence[Path],
    dt: float | None = None,
    gap: float | None = None,
    how: ReadOptions | None = None,
    tell: Callable[[str], None] | None = None,
) -> Dataset:
    """Read logs of one robot at one period, and refuse what is suspect.

    Parameters
    ----------
    paths : sequence of Path
        Files and folders, of any format.
    dt : float, optional
        Period [s]; 0.1, or the first log's own if longer, where not given.
    gap : float, optional
        A longer time between poses ends an episode [s].
    how : ReadOptions, optional
        How the logs are to be read; with ``force`` suspects are told instead of refused.
    tell : callable, optional
        Takes lines about what each log is.

    Raises
    ------
    DataError
        For whatever is wrong, or suspect; where a log is given twice.
    """
    how = ReadOptions() if how is None else how
    dt = None if dt is None else check_time("dt", dt)
    gap = None if gap is None else check_time("gap", gap)
    episodes = []
    files = once(find_logs(paths))
    refuse_unused(files, how)
    for file in files:
        log, verdict = read_checked(file, how, dt)
        dt = model_period(log) if dt is None else dt
        if verdict.delay is not None and not how.force:
            refuse_late(log.name, verdict.delay, dt)
        episodes += cut(log, dt, gap)
        if tell is not None:
            _account(log, verdict, dt, tell)
    return Dataset(episodes)


def read_checked(file: Path, how: ReadOptions, dt: float | None) -> tuple[Log, LogVerdict]:
    """Read one log as closely as a period [s] needs, and refuse what is suspect in it.

    Raises
    ------
    DataError
        Where it cannot be read, or is suspect and not forced.
    """
    if dt is not None:
        how = replace(how, spacing=dt / SAMPLES_PER_PERIOD)
    log = read_log(file, how)
    verdict = judge(log)
    if not how.force:
        verdict.refuse(log)
    return log, verdict


def _account(log: Log, verdict: LogVerdict, dt: float, tell: Callable[[str], None]) -> None:
    """Tell how a log was read, and what is remarkable in it at the model's period [s]."""
    delay = () if verdict.delay is None else (f"motion {tell_delay(verdict.delay, dt)}",)
    forced = (f"suspect, and forced: {suspect.reason}" for suspect in verdict.suspects)
    for line in (*log.notes, *delay, *tell_poses(log, dt), *forced):
        tell(f"{log.name}: {line}")


def once(files: Sequence[Path]) -> Sequence[Path]:
    """Refuse a file that is given twice."""
    seen: set[Path] = set()
    for file in files:
        if file.resolve() in seen:
            raise DataError(
                f"{file}: given twice: what is learned from would be checked against itself"
            )
        seen.add(file.resolve())
    return files
