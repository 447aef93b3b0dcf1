"""Tables: CSV and npz files with a column each for time, pose and command."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import read_npz, real_array, write_whole
from kmpc_lite.learn.dataset import CHUNK
from kmpc_lite.learn.episode import MAX_ROWS, Episode
from kmpc_lite.learn.formats.columns import (
    COLUMNS,
    COMMANDS,
    QUATERNION,
    UNITS,
    Found,
    find_columns,
    listed,
)
from kmpc_lite.learn.formats.csv_table import line_of, read_csv
from kmpc_lite.learn.logs import Log, ReadOptions, Series, parse_units, row_number
from kmpc_lite.types import Array

ENDINGS = (".csv", ".npz", ".tsv", ".txt", ".tum")
WRITTEN = (".csv", ".npz")
MAX_NPZ_BYTES = 8 * 6 * MAX_ROWS
"""Most memory that an npz log may take [bytes]."""
LARGEST = 1e9
"""Largest number of a pose or a command [m, rad, m/s, rad/s]: differences of larger ones are lost
to rounding, and their squares overflow."""


def read_table(file: Path, options: ReadOptions) -> Log:
    """Read a table; its commands from another one, where the options name it.

    Raises
    ------
    DataError
        With file, line and column, for whatever is wrong.
    """
    apart = options.commands is not None
    found, columns, where = _read_columns(file, options)
    poses = _as_poses(columns)
    if not apart and not set(COMMANDS) <= set(columns):
        missing = [name for name in COMMANDS if name not in columns]
        named = " ".join(f"{name}=NAME" for name in missing)
        raise DataError(
            f"{file}: {where(-1)}{', '.join(missing)} missing; expected {','.join(COLUMNS)}, got "
            f"{listed(found.header)}; --columns {named} tells which they are, --commands FILE "
            "gives commands that lie elsewhere"
        )
    _check(file, columns, found, where, options.force)
    notes = found.notes
    series = Series(columns["t"], poses, str(file))
    if options.commands is None:
        values = np.column_stack([columns["v"], columns["omega"]])
        commands = Series(columns["t"], values, str(file))
    else:
        commands = read_commands(options.commands, options)
    log = Log(str(file), series, commands, together=not apart, notes=notes, where=where)
    return _in_header_units(log, found, options, apart)


def read_commands(file: Path, options: ReadOptions) -> Series:
    """Read a table of commands alone: t, v, omega."""
    found, columns, where = _read_columns(file, options, poses=False)
    _check(file, columns, found, where, options.force)
    units = parse_units({k: u for k, u in found.units.items() if k not in options.units})
    values = {k: units[k].apply(c) if k in units else c for k, c in columns.items()}
    return Series(values["t"], np.column_stack([values["v"], values["omega"]]), str(file))


def _in_header_units(log: Log, found: Found, options: ReadOptions, apart: bool) -> Log:
    """A log in SI units, as far as its header tells others; what the user says goes first."""
    from kmpc_lite.learn.logs import correct

    units = {k: u for k, u in found.units.items() if k not in options.units}
    if not units:
        return log
    told = correct(log, ReadOptions(units=units))
    return Log(**{**vars(told), "commands": log.commands}) if apart else told


def _read_columns(
    file: Path, options: ReadOptions, poses: bool = True
) -> tuple[Found, dict[str, Array], Callable[[int], str]]:
    """Columns that are needed (n,) by our name, and how rows are named."""
    if file.suffix.lower() == ".npz":
        found, columns = _read_npz(file, options, poses)
        return found, columns, _row_of_array
    found, columns, header = read_csv(file, options, poses)
    return found, columns, partial(_line_of_text, file, header)


def _row_of_array(row: int) -> str:
    """Name a row of arrays; -1 is what holds the names."""
    return "arrays: " if row < 0 else row_number(row)


def _line_of_text(file: Path, header: bool, row: int) -> str:
    """Name a row of a text; -1 is its header."""
    return "line 1: header: " if row < 0 else line_of(file, row, header)


def _as_poses(columns: dict[str, Array]) -> Array:
    """Poses (n, 3); the heading of quaternions is that of the robot's x axis."""
    theta = columns.get("theta")
    if theta is None:
        theta = heading(*(columns[q] for q in QUATERNION))
    return np.column_stack([columns["x"], columns["y"], theta])


def heading(qx: Array, qy: Array, qz: Array, qw: Array) -> Array:
    """Heading of the robot's x axis, from quaternions of any length [rad]."""
    turned: Array = np.arctan2(2.0 * (qw * qz + qx * qy), qw**2 + qx**2 - qy**2 - qz**2)
    return turned


def _read_npz(file: Path, options: ReadOptions, poses: bool) -> tuple[Found, dict[str, Array]]:
    """Columns from one array each."""
    try:
        names = read_npz(file, ())[1]
        found = find_columns(file, names, options.columns, "arrays", poses)
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
        raise DataError(
            f"{file}: more than {MAX_ROWS:,} rows; cut the log into files and join their datasets"
        )
    return found, {
        name: real_array(array, f"{file}: array {name}", DataError) for name, array in got.items()
    }


def _check(
    file: Path,
    columns: dict[str, Array],
    found: Found,
    where: Callable[[int], str],
    force: bool,
) -> None:
    """Refuse a table that no episode can be made of, with the line."""
    units = dict(zip(COLUMNS, UNITS, strict=True))
    if len(columns["t"]) < 2:
        raise DataError(f"{file}: {len(columns['t'])} row(s); expected at least 2")
    for name, column in columns.items():
        unit = f" in {units[name]}" if name in units and name not in found.units else ""
        wrong = ~np.isfinite(column)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise DataError(
                f"{file}: {where(row)}, column {found.shown(name)}: "
                f"expected a finite number{unit}, got {column[row]}"
            )
        wrong = np.abs(column) > LARGEST
        if name != "t" and wrong.any():
            row = int(np.argmax(wrong))
            raise DataError(
                f"{file}: {where(row)}, column {found.shown(name)}: "
                f"expected at most {LARGEST:g}{unit.removeprefix(' in')}, got {column[row]}"
            )
    time = columns["t"]
    back = np.diff(time) <= 0.0
    if back.any() and not force:
        row = int(np.argmax(back)) + 1
        raise DataError(
            f"{file}: {where(row)}, column {found.shown('t')}: time must grow, got "
            f"{time[row]:.15g} s after {time[row - 1]:.15g} s; --force cuts the log there"
        )


def write_log(episodes: Sequence[Episode], path: str | os.PathLike[str]) -> None:
    """Write episodes one after another, parted by gaps in time; see `Dataset.save`."""
    file = Path(path)
    if file.suffix.lower() not in WRITTEN:
        raise DataError(
            f"{file}: unknown log format {file.suffix or '(no ending)'!r}; "
            f"expected {' or '.join(WRITTEN)}"
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
