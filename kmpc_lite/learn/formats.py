"""Log formats: one reader each, chosen by the file's ending."""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from kmpc_lite.dictionary import Array
from kmpc_lite.errors import DataError
from kmpc_lite.learn.dataset import Episode, resample

COLUMNS = ("t", "x", "y", "theta", "v", "omega")
UNITS = ("s", "m", "m", "rad", "m/s", "rad/s")
MAX_ROWS = 10_000_000
JITTER = 0.1
"""Share of the period by which a time step may differ before the log counts as uneven."""
GAP = 2.5
"""A time step longer than this many periods ends an episode."""


def read_log(path: str | os.PathLike[str], dt: float | None = None, gap: float | None = None) -> list[Episode]:
    """Read a log into episodes; see `Dataset.load`."""
    for name, value in (("dt", dt), ("gap", gap)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise DataError(f"{name}: expected a time > 0 s, got {value}")
    file = Path(path)
    return _episodes(file, _read_table(file), dt, gap)


def read_period(path: str | os.PathLike[str]) -> float:
    """Median time between the rows of a log [s], however uneven it is."""
    return float(np.median(np.diff(_read_table(Path(path))[:, 0])))


def _read_table(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS: at least two, finite, with growing times."""
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise DataError(f"{file}: unknown log format {file.suffix or '(no ending)'!r}; expected {' or '.join(READERS)}")
    try:
        table = reader(file)
    except OSError as error:
        raise DataError(f"{file}: cannot read the log: {error.strerror or error}") from error
    _check_table(file, table)
    return table


def _read_csv(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS."""
    with open(file, encoding="utf-8-sig", errors="replace") as lines:
        header = [name.strip() for name in lines.readline().split(",")]
        if header == [""]:
            raise DataError(f"{file}: empty file; expected the header {','.join(COLUMNS)}")
        _check_names(file, header, "line 1: header")
        try:
            table = np.loadtxt(
                lines, delimiter=",", usecols=[header.index(c) for c in COLUMNS], ndmin=2, max_rows=MAX_ROWS + 1, comments=None
            )
        except ValueError as error:
            raise DataError(f"{file}: {_locate(str(error), header)}") from error
        except UserWarning:  # only where warnings are errors: an empty body is told below
            table = np.empty((0, len(COLUMNS)))
    return table


def _read_npz(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS, from one array per column."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            _check_names(file, archive.files, "arrays")
            columns = [np.asarray(archive[name], dtype=float) for name in COLUMNS]
    except (ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{file}: not an npz log, or damaged: {error}") from error
    shapes = {name: c.shape for name, c in zip(COLUMNS, columns, strict=True)}
    if len(set(shapes.values())) != 1 or columns[0].ndim != 1:
        raise DataError(f"{file}: expected one-dimensional arrays of one length, got {shapes}")
    return np.column_stack(columns)


READERS: dict[str, Callable[[Path], Array]] = {".csv": _read_csv, ".npz": _read_npz}


def _check_names(file: Path, names: Sequence[str], where: str) -> None:
    """Every column once; others are not looked at."""
    missing = [c for c in COLUMNS if c not in names]
    doubled = [c for c in COLUMNS if list(names).count(c) > 1]
    if missing or doubled:
        what = " and ".join(
            part
            for part in (f"{', '.join(missing)} missing" if missing else "", f"{', '.join(doubled)} doubled" if doubled else "")
            if part
        )
        raise DataError(f"{file}: {where}: {what}; expected {','.join(COLUMNS)}, got {','.join(names)}")


def _locate(message: str, header: list[str]) -> str:
    """NumPy's words on a bad row, with the file's own line number and column name."""
    number = re.search(r"string '(.*)' to float64 at row (\d+), column (\d+)", message)
    if number:
        # NumPy counts rows from 0 after the header, columns from 1
        text, row, column = number.group(1), int(number.group(2)), int(number.group(3))
        return f"line {row + 2}, column {header[column - 1]}: expected a number, got {text!r}"
    columns = re.search(r"at row (\d+) with (\d+) columns", message)
    if columns:
        return f"line {int(columns.group(1)) + 1}: expected {len(header)} values, got {columns.group(2)}"
    return message


def _first_line(file: Path) -> int:
    """Number of the first row in the file's own count: after the header of a CSV, from 0 in an npz."""
    return 2 if file.suffix.lower() == ".csv" else 0


def _check_table(file: Path, table: Array) -> None:
    """Refuse a table that no episode can be made of, with the line."""
    if len(table) > MAX_ROWS:
        raise DataError(f"{file}: more than {MAX_ROWS:,} rows; cut the log into files and join their datasets")
    if len(table) < 2:
        raise DataError(f"{file}: {len(table)} row(s); expected at least 2")
    first_line = _first_line(file)
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0]
        raise DataError(
            f"{file}: line {row + first_line}, column {COLUMNS[column]}: expected a finite number in {UNITS[column]}, "
            f"got {table[row, column]}"
        )
    steps = np.diff(table[:, 0])
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0))
        raise DataError(
            f"{file}: line {row + 1 + first_line}, column t: time must grow, got {table[row + 1, 0]:g} s after {table[row, 0]:g} s"
        )


def _episodes(file: Path, table: Array, dt: float | None, gap: float | None) -> list[Episode]:
    """Cut rows (n, 6) at the gaps, check that they are even, resample."""
    steps = np.diff(table[:, 0])
    first_line = _first_line(file)
    period = float(np.median(steps))
    limit = GAP * period if gap is None else gap
    whole = steps <= limit
    uneven = whole & (np.abs(steps - period) > JITTER * period)
    if dt is None and uneven.any():
        row = int(np.argmax(uneven))
        raise DataError(
            f"{file}: line {row + 1 + first_line}, column t: uneven sampling, a step of {steps[row]:g} s where the median is {period:g} s; "
            "give dt= (--dt) to resample"
        )
    episodes = []
    for rows in np.split(table, np.flatnonzero(~whole) + 1):
        if len(rows) >= 2 and (episode := _episode(rows, period, dt)) is not None:
            episodes.append(episode)
    if not episodes:
        raise DataError(
            f"{file}: no two rows closer than {limit:g} s (the gap limit), or none as long as one period: nothing to learn from"
        )
    return episodes


def _episode(rows: Array, period: float, dt: float | None) -> Episode | None:
    """One episode from rows without a gap: as logged, or on an even grid of its own."""
    poses = rows[:, 1:4].copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    poses[:, 2] -= 2 * np.pi * np.round(poses[0, 2] / (2 * np.pi))
    if dt is None:
        # the mean period over the file's digits: 0.05 rather than 0.04999999999
        return Episode(poses, rows[:-1, 4:], float(np.round(period, 9)))
    return resample(rows[:, 0], poses, rows[:-1, 4:], dt)


def write_log(episodes: Sequence[Episode], path: str | os.PathLike[str]) -> None:
    """Write episodes one after another, parted by gaps in time; see `Dataset.save`."""
    file = Path(path)
    if file.suffix.lower() not in READERS:
        raise DataError(f"{file}: unknown log format {file.suffix or '(no ending)'!r}; expected {' or '.join(READERS)}")
    tables, start = [], 0.0
    for e in episodes:
        time = start + np.arange(len(e) + 1) * e.dt
        tables.append(np.column_stack([time, e.states, np.vstack([e.inputs, e.inputs[-1:]])]))
        start = time[-1] + max(10.0, 10 * e.dt)
    table = np.vstack(tables)
    temporary = file.with_name(file.name + ".part")
    try:
        with open(temporary, "wb") as out:
            if file.suffix.lower() == ".csv":
                np.savetxt(out, table, fmt="%.12g", delimiter=",", header=",".join(COLUMNS), comments="")
            else:
                np.savez_compressed(out, allow_pickle=False, **dict(zip(COLUMNS, table.T, strict=True)))
        os.replace(temporary, file)
    except OSError as error:
        raise DataError(f"{file}: cannot write the log: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
