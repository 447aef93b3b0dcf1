"""Log formats: one reader each, chosen by the file's ending."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import read_npz, real_array, write_whole
from kmpc_lite.learn.dataset import CHUNK, MAX_ROWS, Episode, check_time, resample
from kmpc_lite.reading import text_lines
from kmpc_lite.types import Array

COLUMNS = ("t", "x", "y", "theta", "v", "omega")
UNITS = ("s", "m", "m", "rad", "m/s", "rad/s")
MAX_HEADER = 10_000
"""Characters of the longest first line that is looked at."""
MAX_LINE = 100_000
"""Characters of the longest line: a file without line ends is no table."""
MAX_NPZ_BYTES = 8 * 6 * MAX_ROWS
"""Memory of the largest npz log."""
JITTER = 0.1
"""Share of the period by which a time step may differ before the log counts as uneven."""
DRIFT = 0.01
"""Share of the median step by which the mean may differ before the log counts as uneven."""
LARGEST = 1e9
"""Beyond this a pose or a command [m, rad, m/s, rad/s] is none: differences of such numbers are
lost to rounding, squares overflow."""
GAP = 2.5
"""A time step longer than this many periods ends an episode."""


def read_log(
    path: str | os.PathLike[str], dt: float | None = None, gap: float | None = None
) -> list[Episode]:
    """Read a log into episodes; see `Dataset.load`."""
    dt = None if dt is None else check_time("dt", dt)
    gap = None if gap is None else check_time("gap", gap)
    file = Path(path)
    return _episodes(file, _read_table(file), dt, gap)


def read_period(path: str | os.PathLike[str]) -> float:
    """Median time between the rows of a log [s], however uneven it is."""
    time = _read_table(Path(path))[:, 0]
    return _tidy(float(np.median(np.diff(time))), 2.0 * float(np.spacing(np.abs(time).max())))


def _read_table(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS: at least two, finite, with growing times."""
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise DataError(
            f"{file}: unknown log format {file.suffix or '(no ending)'!r}; "
            f"expected {' or '.join(READERS)}"
        )
    try:
        table = reader(file)
    except DataError:
        raise
    except (OSError, ValueError) as error:
        raise DataError(
            f"{file}: cannot read the log: {getattr(error, 'strerror', None) or error}"
        ) from error
    _check_table(file, table)
    return table


def _read_csv(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        line = next(lines, "")
        if len(line) >= MAX_HEADER or not line.strip():
            what = (
                "line 1 is too long"
                if line.strip()
                else "line 1 is blank"
                if line
                else "empty file"
            )
            raise DataError(f"{file}: {what}; expected the header {','.join(COLUMNS)}")
        header = [name.strip() for name in _values(line)]
        _check_names(file, header, "line 1: header")
        rows = _rows(file, lines, len(header))
        first = next(rows, None)
        if first is None:
            return np.empty((0, len(COLUMNS)))
        try:
            wanted = [header.index(c) for c in COLUMNS]
            return np.loadtxt(
                chain([first], rows),
                delimiter=",",
                usecols=wanted,
                ndmin=2,
                comments=None,
                quotechar='"',
            )
        except DataError:
            raise
        except ValueError as error:
            raise DataError(f"{file}: {_bad_value(file, header) or error}") from error


def _values(line: str) -> list[str]:
    """Values of one line; quotes may hold commas."""
    try:
        return next(csv.reader([line]), [])
    except csv.Error:  # a value of more than 100,000 characters
        return line.split(",")


def _rows(file: Path, lines: Iterator[str], width: int) -> Iterator[str]:
    """Yield the lines that are not blank; each must have as many values as the header."""
    rows = 0
    for number, line in enumerate(lines, 2):
        quoted = '"' in line
        if quoted and line.count('"') % 2:
            raise DataError(f"{file}: line {number}: a quote without its end")
        if quoted or line.count(",") != width - 1:
            if not line.strip():
                continue
            if (count := len(_values(line))) != width:
                raise DataError(
                    f"{file}: line {number}: expected {width} values as in the header, got {count}"
                )
        rows += 1
        if rows > MAX_ROWS:
            raise DataError(
                f"{file}: more than {MAX_ROWS:,} rows; "
                "cut the log into files and join their datasets"
            )
        yield line


def _bad_value(file: Path, header: list[str]) -> str | None:
    """Find the first value that is no number: its line, column and text."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        for number, line in islice(enumerate(lines, 1), 1, None):
            values = _values(line)
            for name in COLUMNS if line.strip() else ():
                if not _is_number(text := values[header.index(name)].strip()):
                    return f"line {number}, column {name}: expected a number, got {_short(text)!r}"
    return None


def _is_number(text: str) -> bool:
    """Whether NumPy reads it: Python takes 1_000 and other scripts' digits too."""
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text


def _read_npz(file: Path) -> Array:
    """Rows (n, 6) in the order of COLUMNS, from one array per column."""
    try:
        arrays, names = read_npz(file, COLUMNS, MAX_NPZ_BYTES)
    except OSError:
        raise
    except ValueError as error:
        raise DataError(f"{file}: not an npz log, or damaged: {error}") from error
    _check_names(file, names, "arrays")
    shapes = {name: arrays[name].shape for name in COLUMNS}
    if len(set(shapes.values())) != 1 or len(shapes["t"]) != 1:
        raise DataError(f"{file}: expected one-dimensional arrays of one length, got {shapes}")
    if shapes["t"][0] > MAX_ROWS:
        raise DataError(
            f"{file}: more than {MAX_ROWS:,} rows; cut the log into files and join their datasets"
        )
    table = np.empty((shapes["t"][0], len(COLUMNS)))
    for column, name in enumerate(COLUMNS):
        table[:, column] = real_array(arrays.pop(name), f"{file}: array {name}", DataError)
    return table


READERS: dict[str, Callable[[Path], Array]] = {".csv": _read_csv, ".npz": _read_npz}


def _check_names(file: Path, names: Sequence[str], where: str) -> None:
    """Every column once; others are not looked at."""
    missing = [c for c in COLUMNS if c not in names]
    doubled = [c for c in COLUMNS if list(names).count(c) > 1]
    if missing or doubled:
        what = " and ".join(
            f"{', '.join(which)} {how}"
            for which, how in ((missing, "missing"), (doubled, "doubled"))
            if which
        )
        raise DataError(
            f"{file}: {where}: {what}; "
            f"expected {','.join(COLUMNS)}, got {_short(','.join(names)) or 'nothing'}"
        )


def _short(text: str) -> str:
    """Make text fit for an error's one line, whatever it was read from."""
    printable = "".join(c if c.isprintable() else "?" for c in text[:61])
    return printable if len(printable) <= 60 else printable[:57] + "..."


def _where(file: Path, row: int) -> str:
    """Name a row as its file does.

    Lines of text count from 1, with the header and blank lines; rows of arrays count from 0.
    """
    if file.suffix.lower() != ".csv":
        return f"row {row}"
    with closing(text_lines(file, MAX_LINE)) as lines:
        numbers = (number for number, line in enumerate(lines, 1) if number > 1 and line.strip())
        return f"line {next(islice(numbers, row, None), row + 2)}"


def _check_table(file: Path, table: Array) -> None:
    """Refuse a table that no episode can be made of, with the line."""
    if len(table) < 2:
        raise DataError(f"{file}: {len(table)} row(s); expected at least 2")
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0]
        raise DataError(
            f"{file}: {_where(file, row)}, column {COLUMNS[column]}: "
            f"expected a finite number in {UNITS[column]}, got {table[row, column]}"
        )
    if (np.abs(table[:, 1:]) > LARGEST).any():
        row, column = np.argwhere(np.abs(table[:, 1:]) > LARGEST)[0] + (0, 1)
        raise DataError(
            f"{file}: {_where(file, row)}, column {COLUMNS[column]}: "
            f"expected at most {LARGEST:g} {UNITS[column]}, got {table[row, column]}"
        )
    time = table[:, 0]
    back = np.diff(time) <= 0.0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise DataError(
            f"{file}: {_where(file, row)}, column t: "
            f"time must grow, got {time[row]:.15g} s after {time[row - 1]:.15g} s"
        )


def _episodes(file: Path, table: Array, dt: float | None, gap: float | None) -> list[Episode]:
    """Cut rows (n, 6) at the gaps, check that they are even, resample."""
    steps = np.diff(table[:, 0])
    period = float(np.median(steps))
    limit = GAP * period if gap is None else gap
    whole = steps <= limit
    if not whole.any():
        raise DataError(
            f"{file}: no two rows closer than {limit:g} s (the gap limit): nothing to learn from"
        )
    if dt is None:
        period = _even_period(file, table[:, 0], whole, period)
    parts = np.split(table, np.flatnonzero(~whole) + 1)
    episodes = [
        e for rows in parts if len(rows) >= 2 and (e := _episode(rows, period, dt)) is not None
    ]
    if not episodes:
        raise DataError(
            f"{file}: no drive without a gap is as long as one period of {dt:g} s: "
            "nothing to learn from"
        )
    return episodes


def _even_period(file: Path, time: Array, whole: Array, median: float) -> float:
    """Give the period of an evenly sampled log [s]."""
    steps = np.diff(time)
    uneven = whole & (np.abs(steps - median) > JITTER * median)
    if uneven.any():
        row = int(np.argmax(uneven)) + 1
        raise DataError(
            f"{file}: {_where(file, row)}, column t: "
            f"uneven sampling, a step of {steps[row - 1]:g} s where the median is {median:g} s; "
            "give dt= (--dt) to resample"
        )
    count, pieces = int(whole.sum()), 1 + int(np.sum(~whole))
    mean = float(steps[whole].mean())
    if abs(mean - median) > DRIFT * median:
        raise DataError(
            f"{file}: column t: "
            f"uneven sampling, steps of {mean:g} s in the mean but {median:g} s in the median; "
            "give dt= (--dt) to resample"
        )
    # the mean over a piece is known better than one step, by as many times as it has steps
    return _tidy(mean, 2.0 * float(np.spacing(np.abs(time).max())) * pieces / count)


def _tidy(period: float, resolution: float) -> float:
    """Round a period to what the time stamps can tell [s].

    With stamps that count from 1970 it is 0.05 s rather than 0.0499999523 s.
    """
    tolerance = max(1e-9 * period, resolution)
    candidates = (round(period, digits) for digits in range(16))
    return next((c for c in candidates if c > 0.0 and abs(c - period) <= tolerance), period)


def _episode(rows: Array, period: float, dt: float | None) -> Episode | None:
    """One episode from rows without a gap: as logged, or on an even grid of its own."""
    poses = rows[:, 1:4].copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    poses[:, 2] -= 2 * np.pi * np.round(poses[0, 2] / (2 * np.pi))
    if dt is None:
        return Episode(poses, rows[:-1, 4:], period)
    return resample(rows[:, 0], poses, rows[:-1, 4:], dt)


def write_log(episodes: Sequence[Episode], path: str | os.PathLike[str]) -> None:
    """Write episodes one after another, parted by gaps in time; see `Dataset.save`."""
    file = Path(path)
    if file.suffix.lower() not in READERS:
        raise DataError(
            f"{file}: unknown log format {file.suffix or '(no ending)'!r}; "
            f"expected {' or '.join(READERS)}"
        )
    if (rows := sum(len(e) + 1 for e in episodes)) > MAX_ROWS:
        raise DataError(
            f"{file}: {rows:,} rows, a log holds at most {MAX_ROWS:,}: split the dataset"
        )
    tables, start = [], 0.0
    for e in episodes:
        time = start + np.arange(len(e) + 1) * e.dt
        tables.append(np.column_stack([time, e.states, np.vstack([e.inputs, e.inputs[-1:]])]))
        start = time[-1] + max(10.0, 10 * e.dt)
    table = np.vstack(tables)
    try:
        with write_whole(file) as out:
            if file.suffix.lower() == ".csv":
                text = io.TextIOWrapper(out, "ascii", newline="")
                writer = csv.writer(
                    text, lineterminator="\n"
                )  # floats with as few digits as bring them back exactly
                writer.writerow(COLUMNS)
                for k in range(0, len(table), CHUNK):
                    writer.writerows(table[k : k + CHUNK].tolist())
                text.detach()
            else:
                np.savez_compressed(
                    out, allow_pickle=False, **dict(zip(COLUMNS, table.T, strict=True))
                )
    except (OSError, ValueError) as error:
        raise DataError(
            f"{file}: cannot write the log: {getattr(error, 'strerror', None) or error}"
        ) from error
