"""Tables: CSV of any delimiter, TUM trajectories, and npz files, a column each for what is told."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import read_npz, real_array, write_whole
from kmpc_lite.geometry import heading_of
from kmpc_lite.learn.dataset import CHUNK, MAX_ROWS, Episode
from kmpc_lite.learn.formats.columns import (
    CAR_OMEGA,
    COLUMNS,
    MEASURED,
    QUATERNION,
    WAYS,
    Found,
    find_columns,
    listed,
    short,
)
from kmpc_lite.learn.formats.streams import local_metres, two_or_three
from kmpc_lite.learn.logs import (
    KNOWN,
    LARGEST,
    TURN_RATE,
    Log,
    ReadOptions,
    Series,
    in_units,
    parse_units,
)
from kmpc_lite.reading import text_lines
from kmpc_lite.types import INPUTS, Array

WRITTEN = (".csv", ".npz")
MAX_NPZ_BYTES = 8 * 6 * MAX_ROWS  # most memory that an npz log may take [bytes]
MAX_HEADER, MAX_LINE, MAX_REMARKS = 10_000, 100_000, 100
"""Characters of the longest header, and of the longest line; remarks before the header."""
MISSING = ("", "nan", "none", "null", "na", "n/a")
"""What stands where a value is missing, in lower case."""
EPOCH_NANOSECONDS = 9e17
"""Times that are larger count nanoseconds since 1970, from 1998 on: no robot runs so long [s]."""
DELIMITERS = (",", ";", "\t", "|")
EXPORTS = {
    **dict.fromkeys(("Objects", "Segments", "Trajectories", "Joints"), "an export of Vicon Nexus"),
    **{"Format Version,": "an export of OptiTrack Motive", "NO_OF_FRAMES": "an export of QTM"},
}
"""How exports of motion capture begin."""
TUM = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of a trajectory as the TUM benchmark has them."""
HEADER = re.compile(r"(t|time|stamp|timestamp)\b", re.IGNORECASE)
"""How a remark begins that is the header: EuRoC's with #timestamp [ns]."""
UNIT = re.compile(r"(?!(nan|none|null|na|n/a)$)[a-zµ°%/^*.-]*\d?", re.IGNORECASE)
"""What stands in a row of units below a header."""


@dataclass(frozen=True)
class Table:
    """What is needed of a table."""

    file: Path
    found: Found
    columns: dict[str, Array]  # values (n,) by our name
    where: Callable[[int], str]  # names a row as its file does; -1 is its header


def read_table(file: Path, options: ReadOptions) -> Log:
    """Read a table; its commands from another one, where the options name it.

    Raises DataError with file, line and column, for whatever is wrong.
    """
    whole, elsewhere = _read(file, options), options.commands
    found, apart = whole.found, elsewhere is None and _told_apart(whole)
    table, notes = _whole(whole, options.force, found.command if elsewhere or apart else ())
    columns, time = table.columns, table.columns["t"]
    if elsewhere is None and not found.command:
        missing = [name for name in WAYS["command"][0] if name not in columns]
        named = " ".join(f"{name}=NAME" for name in missing)
        raise DataError(
            f"{file}: {table.where(-1)}: {', '.join(missing)} missing; expected "
            f"{','.join(COLUMNS)}, got {listed(found.header)}; --columns {named} tells which they "
            "are, --commands FILE gives commands that lie elsewhere"
        )
    measured = elsewhere is None and found.measured(options.columns)
    said = (f"{MEASURED} (--commands FILE gives them)",) * measured
    told, notes = table, (*found.notes(options.columns), *said, *notes)
    if elsewhere or apart:
        told = whole if elsewhere is None else _read(elsewhere, options, poses=False)
        told, more = _whole(told, options.force, columns.keys() - {"t"} if apart else ())
        for name, theirs in options.columns.items():
            if theirs not in (*found.header, *told.found.header):
                lacks = f"{file}: columns: {name}={short(theirs)}: no such column"
                raise DataError(f"{lacks}, nor in {elsewhere}")
        notes = (*notes, *more)
    values, kinds = _commands(told, options)
    poses, held = Series(time, _poses(table, options), str(file)), told.columns["t"]
    wheels = told.found.command == ("left", "right")
    log = Log(
        str(file),
        in_units(poses, ("x", "y", "theta"), found.units),
        in_units(Series(held, values, str(told.file)), kinds, told.found.units),
        told is table,
        measured=measured,
        notes=notes,
        where=table.where,
        columns=kinds,
        units={**found.units, **told.found.units},
        wheel_speeds=wheels,
        geometry={"track": options.track} if wheels and options.track else {},
    )
    return two_or_three(log)


def _chosen(options: ReadOptions, header: Sequence[str]) -> Mapping[str, str]:
    """Columns that the user names; of two tables each has some."""
    if options.commands is None:
        return options.columns
    return {name: theirs for name, theirs in options.columns.items() if theirs in header}


def _read(file: Path, options: ReadOptions, poses: bool = True) -> Table:
    """All rows, with NaN where something is missing."""
    if file.suffix.lower() == ".npz":
        return _read_npz(file, options, poses)
    try:
        return _read_text(file, options, poses, tolerant=False)
    except DataError:
        raise
    except ValueError:  # values are missing, times are dates, or something is wrong
        return _read_text(file, options, poses, tolerant=True)


def _told_apart(table: Table) -> bool:
    """Whether poses and commands stand in rows of their own, as where topics are exported."""
    lacks = {n: np.isnan(values) for n, values in table.columns.items() if n != "t"}
    commands = [lacks.pop(n) for n in table.found.command]
    posed, told = ~np.any([*lacks.values()], axis=0), ~np.any(commands, axis=0)
    return bool(commands) and 2 * np.sum(posed & told) < min(np.sum(posed), np.sum(told))


def _whole(table: Table, force: bool, but: Collection[str] = ()) -> tuple[Table, tuple[str, ...]]:
    """Rows in which nothing is missing `but` in some columns, and a note on the others.

    Where most rows that have any value miss one, all are kept, and the check names the first.
    """
    columns = {n: values for n, values in table.columns.items() if n not in but}
    lacking = {n: np.isnan(values) for n, values in columns.items()}
    notes, where = tuple[str, ...](), table.where
    empty = np.all([lacks for n, lacks in lacking.items() if n != "t"], axis=0)
    kept = ~np.any([*lacking.values()], axis=0)
    if not kept.all() and 2 * int(kept.sum()) >= int((~empty).sum()):
        rows, lost = np.flatnonzero(kept), int((~kept & ~empty).sum())
        names = ", ".join(table.found.shown(n) for n, missing in lacking.items() if missing.any())
        notes = (f"{lost} rows without a number in {names} were left out",) * bool(lost)
        columns = {n: values[rows] for n, values in columns.items()}
        where = lambda row: table.where(int(rows[row]) if row >= 0 else row)  # noqa: E731
    complete = replace(table, columns=columns, where=where)
    _check(complete, force)
    return complete, notes


def _check(table: Table, force: bool) -> None:
    """Refuse a table that no episode can be made of, with the line."""
    file, time = table.file, table.columns["t"]
    if len(time) < 2:
        raise DataError(f"{file}: {len(time)} row(s); expected at least 2")
    for name, column in table.columns.items():
        si = next((unit for unit, size in KNOWN.get(name, {}).items() if size == 1.0), "")
        unit = f" {si}" if si and name not in table.found.units else ""
        for wrong, wanted in (
            (~np.isfinite(column), f"a finite number{' in' * bool(unit)}{unit}"),
            ((np.abs(column) > LARGEST) & (name != "t"), f"at most {LARGEST:g}{unit}"),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                raise DataError(
                    f"{file}: {table.where(row)}, column {table.found.shown(name)}: "
                    f"expected {wanted}, got {column[row]}"
                )
    if (back := np.diff(time) <= 0.0).any() and not force:
        row = int(np.argmax(back)) + 1
        raise DataError(
            f"{file}: {table.where(row)}, column {table.found.shown('t')}: time must grow, got "
            f"{time[row]:.15g} s after {time[row - 1]:.15g} s; --force cuts the log there"
        )


def _poses(table: Table, options: ReadOptions) -> Array:
    """Poses (n, 3); the heading of quaternions is that of the robot's x axis."""
    columns = table.columns
    theta = columns.get("theta")
    if theta is None:
        theta = heading_of(*(columns[q] for q in QUATERNION))
    if "lat" not in columns:
        return np.column_stack([columns["x"], columns["y"], theta])
    north, east = local_metres(*_in_units(table, ("lat", "lon"), options)).T
    return np.column_stack([east, north, theta])


def _in_units(table: Table, names: tuple[str, ...], options: ReadOptions) -> list[Array]:
    """Columns that become others, in the units that the user gave, or the header."""
    units = parse_units({**table.found.units, **options.units})
    return [units[n].apply(table.columns[n]) if n in units else table.columns[n] for n in names]


def _commands(table: Table, options: ReadOptions) -> tuple[Array, tuple[str, ...]]:
    """Commands (n, m), also of a left and a right wheel, and what their numbers are."""
    found, kinds = table.found, table.found.command
    if kinds != ("left", "right"):
        return np.column_stack([table.columns[name] for name in kinds]), kinds
    if options.track is None:
        raise DataError(
            f"{table.file}: commands are speeds of a left and a right wheel: --track M tells how "
            "far apart they are"
        )
    told, sides = {**found.units, **options.units}, _in_units(table, kinds, options)
    for k, name in enumerate(kinds):
        if told.get(name) in TURN_RATE:
            if options.wheel_radius is None:
                raise DataError(
                    f"{table.file}: {name} is in {told[name]}, the turns of a wheel: "
                    "--wheel-radius M tells how large it is"
                )
            sides[k] = sides[k] * options.wheel_radius
    left, right = sides
    both = np.column_stack([0.5 * (left + right), (right - left) / options.track])
    return both, ("v", "omega")


def _read_npz(file: Path, options: ReadOptions, poses: bool) -> Table:
    """Columns from one array each."""
    try:
        names = read_npz(file, ())[1]
        chosen = _chosen(options, names)
        found = find_columns(file, names, chosen, "arrays", poses, options.units)
        arrays, _ = read_npz(file, found.names.values(), MAX_NPZ_BYTES)
    except (OSError, DataError):
        raise
    except ValueError as error:
        raise DataError(f"{file}: not an npz log, or damaged: {error}") from error
    got = {name: arrays[theirs] for name, theirs in found.names.items()}
    shapes = {name: array.shape for name, array in got.items()}
    if len(set(shapes.values())) != 1 or len(shapes["t"]) != 1:
        raise DataError(f"{file}: expected one-dimensional arrays of one length, got {shapes}")
    if shapes["t"][0] > MAX_ROWS:
        raise _too_long(file)
    columns = {n: real_array(a, f"{file}: array {n}", DataError) for n, a in got.items()}
    return Table(file, found, columns, lambda row: "arrays" if row < 0 else f"row {row}")


def _too_long(file: Path) -> DataError:
    return DataError(
        f"{file}: more than {MAX_ROWS:,} rows; cut the log into files and join their datasets"
    )


# text


@dataclass(frozen=True)
class Layout:
    """How the text of a table is to be read."""

    header: list[str]
    delimiter: str | None  # what parts the values of a line; None stands for blanks
    skipped: int  # lines before the first row
    first: str  # the first row, if that was read already to see it
    where: str  # what messages call the header

    def is_row(self, line: str) -> bool:
        """Whether a line holds values."""
        remark = self.delimiter is None and line.lstrip().startswith("#")
        return bool(line.strip()) and not remark


def _values(line: str, delimiter: str | None) -> list[str]:
    """Values of one line; quotes may hold delimiters."""
    if delimiter is None:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # a value of more than 100,000 characters
        return line.split(delimiter)


def _read_text(file: Path, options: ReadOptions, poses: bool, tolerant: bool) -> Table:
    """Read the columns; a table in which every value is a number takes a tenth of the time."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        layout = _layout(file, lines)
        chosen = _chosen(options, layout.header)
        found = find_columns(file, layout.header, chosen, layout.where, poses, options.units)
        where, rows = partial(_line_of, file, layout), _rows(file, lines, layout)
        if (first := next(rows, None)) is None:
            return Table(file, found, {name: np.empty(0) for name in found.where}, where)
        parsers = {p: parse_time if n == "t" else parse_number for n, p in found.where.items()}
        try:
            table = np.loadtxt(
                chain([first], rows),
                delimiter=layout.delimiter,
                usecols=list(found.where.values()),
                ndmin=2,
                comments=None,
                quotechar='"',
                converters=dict(parsers.items()) if tolerant else None,
                encoding="utf-8",
            )
        except DataError:
            raise
        except ValueError as error:
            if not tolerant:
                raise
            raise DataError(f"{file}: {_bad_value(file, layout, found) or error}") from error
    columns = dict(zip(found.where, table.T, strict=True))
    if "ns" in columns and not (columns["ns"] >= 1e9).any():  # else they are a clock of their own
        columns["t"] = columns["t"] + 1e-9 * columns["ns"]
    told = {*found.units, *options.units}
    if "t" not in told and np.median(columns["t"]) > EPOCH_NANOSECONDS:
        found = replace(found, units={**found.units, "t": "ns"})
    return Table(file, found, columns, where)


def parse_number(text: str) -> float:
    """Read a number as NumPy does; NaN if it is missing."""
    bare = text.strip()
    if bare.lower() in MISSING:
        return float("nan")
    if not _is_number(bare):
        raise ValueError(bare)
    return float(bare)


def _is_number(text: str) -> bool:
    """Whether NumPy reads it: Python takes 1_000 and other scripts' digits too."""
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text


def parse_time(text: str) -> float:
    """Read a number, or a date and a time, or that alone, as ISO 8601 has them, in seconds."""
    try:
        return parse_number(text)
    except ValueError:
        bare = text.strip().replace("/", "-", 2).replace("/", "T")
        when = datetime.fromisoformat(bare if bare[2:3] != ":" else f"1970-01-01T{bare}")
    # if no zone is given only differences count, and those of local clocks may jump by an hour
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def _layout(file: Path, lines: Iterator[str]) -> Layout:
    """Read the header, or see that there is none because it is a TUM trajectory."""
    for number in range(1, MAX_REMARKS + 1):
        line = next(lines, "")
        if len(line) >= MAX_HEADER or not line.strip():
            what = "too long" if line.strip() else "blank" if line else ""
            told = f"line {number} is {what}" if what else "empty file"
            raise DataError(f"{file}: {told}; expected the header {','.join(COLUMNS)}")
        for start, what in EXPORTS.items():
            if number == 1 and line.startswith(start):
                raise DataError(
                    f"{file}: {what}, which holds no commands: write a CSV with the columns "
                    "t,x,y,theta of its rows (t in s from frame and rate, theta the yaw), and give "
                    "the commands by --commands FILE"
                )
        if len(values := line.split()) == len(TUM) and all(map(_is_number, values)):
            return Layout(list(TUM), None, number - 1, line, f"line {number}")
        if not line.lstrip().startswith("#") or HEADER.match(line.lstrip(" #%")):
            text = line.strip("\r\n").lstrip(" #%")
            most = max(DELIMITERS, key=text.count)
            delimiter = most if most in text else None
            names = [name.strip() for name in _values(text, delimiter)]
            if all(map(_is_number, names)):
                told = f"line {number} holds numbers; expected a header before it, as of"
                raise DataError(f"{file}: {told} {','.join(COLUMNS)}")
            where, below = f"line {number}: header", next(lines, "")
            units = [unit.strip(" []()\r\n") for unit in _values(below, delimiter)]
            if len(units) != len(names) or not all(map(UNIT.fullmatch, units)) or not any(units):
                return Layout(names, delimiter, number, below, where)
            names = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
            return Layout(names, delimiter, number + 1, "", where)
    raise DataError(f"{file}: {MAX_REMARKS} lines of remarks; expected {','.join(COLUMNS)}")


def _rows(file: Path, lines: Iterator[str], layout: Layout) -> Iterator[str]:
    """Yield the lines that are not blank; each must have as many values as the header."""
    width, delimiter, rows = len(layout.header), layout.delimiter, 0
    begin = chain([layout.first], lines) if layout.first else lines
    for number, line in enumerate(begin, layout.skipped + 1):
        quoted = '"' in line
        if quoted and line.count('"') % 2:
            raise DataError(f"{file}: line {number}: a quote without its end")
        if delimiter is None or quoted or line.count(delimiter) != width - 1:
            if not layout.is_row(line):
                continue
            if (count := len(_values(line, delimiter))) != width:
                raise DataError(
                    f"{file}: line {number}: expected {width} values as in the header, got {count}"
                )
        rows += 1
        if rows > MAX_ROWS:
            raise _too_long(file)
        yield line.replace(",", ".") if delimiter == ";" else line


def _bad_value(file: Path, layout: Layout, found: Found) -> str | None:
    """Find the first value that is no number: its line, column and text."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        for number, line in islice(enumerate(lines, 1), layout.skipped, None):
            values = _values(line, layout.delimiter)
            for name, place in found.where.items() if line.strip() else ():
                text = values[place].strip() if place < len(values) else ""
                parse = parse_time if name == "t" else parse_number
                try:
                    parse(text.replace(",", ".") if layout.delimiter == ";" else text)
                except ValueError:
                    told = f"expected a number, got {short(text)!r}"
                    return f"line {number}, column {found.shown(name)}: {told}"
    return None


def _line_of(file: Path, layout: Layout, row: int) -> str:
    """Name a row as its file does: lines count from 1, with remarks, header and blank lines."""
    if row < 0:
        return layout.where
    with closing(text_lines(file, MAX_LINE)) as lines:
        numbers: Iterator[int] = (
            number
            for number, line in enumerate(lines, 1)
            if number > layout.skipped and layout.is_row(line)
        )
        return f"line {next(islice(numbers, row, None), row + 1 + layout.skipped)}"


def write_log(episodes: Sequence[Episode], path: str | os.PathLike[str]) -> None:
    """Write episodes one after another, parted by gaps in time; see `Dataset.save`."""
    file = Path(path)
    if file.suffix.lower() not in WRITTEN:
        raise DataError(
            f"{file}: unknown log format {file.suffix or '(no ending)'!r}; "
            f"expected {' or '.join(WRITTEN)}"
        )
    if (rows := sum(len(e) + 1 for e in episodes)) > MAX_ROWS:
        raise DataError(f"{file}: {rows:,} rows, a log holds {MAX_ROWS:,}: split the dataset")
    *names, omega = COLUMNS
    names += ["lateral"] * (episodes[0].inputs.shape[1] - INPUTS)
    names.append(CAR_OMEGA if episodes[0].steered else omega)
    tables, start = [], 0.0
    for e in episodes:
        time = start + np.arange(len(e) + 1) * e.dt
        tables.append(np.column_stack([time, e.states, np.vstack([e.inputs, e.inputs[-1:]])]))
        start = time[-1] + max(10.0, 10 * e.dt)
    table = np.vstack(tables)
    try:
        with write_whole(file) as out:
            if file.suffix.lower() == ".npz":
                np.savez_compressed(
                    out, allow_pickle=False, **dict(zip(names, table.T, strict=True))
                )
                return
            text = io.TextIOWrapper(out, "ascii", newline="")
            # floats with as few digits as bring them back exactly
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow(names)
            for k in range(0, len(table), CHUNK):
                writer.writerows(table[k : k + CHUNK].tolist())
            text.detach()
    except (OSError, ValueError) as error:
        raise DataError(
            f"{file}: cannot write the log: {getattr(error, 'strerror', None) or error}"
        ) from error
