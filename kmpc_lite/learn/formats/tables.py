"""Tables: CSV and npz files with a column each for time, pose and command."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import read_npz, real_array, write_whole
from kmpc_lite.geometry import heading_of
from kmpc_lite.learn.dataset import CHUNK
from kmpc_lite.learn.episode import MAX_ROWS, Episode
from kmpc_lite.learn.formats.columns import (
    CAR_OMEGA,
    COLUMNS,
    QUATERNION,
    WAYS,
    Found,
    find_columns,
    listed,
)
from kmpc_lite.learn.formats.csv_table import Layout, line_of, read_csv
from kmpc_lite.learn.formats.streams import local_metres
from kmpc_lite.learn.logs import (
    KNOWN,
    TURN_RATE,
    Log,
    ReadOptions,
    Series,
    correct,
    in_units,
    parse_units,
    row_number,
)
from kmpc_lite.types import INPUTS, Array

WRITTEN = (".csv", ".npz")
MAX_NPZ_BYTES = 8 * 6 * MAX_ROWS
"""Most memory that an npz log may take [bytes]."""
SIDEWAYS = 0.05
"""Share of the largest speed ahead from which on a speed to the left is that of an omni."""
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
    found, columns, where = _read_columns(file, options)
    if options.commands is None and not found.command:
        missing = [name for name in WAYS["command"][0] if name not in columns]
        named = " ".join(f"{name}=NAME" for name in missing)
        raise DataError(
            f"{file}: {where(-1)}{', '.join(missing)} missing; expected {','.join(COLUMNS)}, got "
            f"{listed(found.header)}; --columns {named} tells which they are, --commands FILE "
            "gives commands that lie elsewhere"
        )
    columns, where, notes = _whole_rows(columns, found, where)
    _check(file, columns, found, where, options.force)
    units = _header_units(found, options)
    poses = Series(columns["t"], _poses(columns, found, options), str(file))
    if options.commands is not None:
        held, kinds, more = read_commands(options.commands, options)
        poses, notes = in_units(poses, ("x", "y", "theta"), units), (*found.notes, *notes, *more)
        return Log(str(file), poses, held, notes=notes, where=where, columns=kinds)
    values, kinds, more = _commands(file, columns, found, options)
    held = Series(columns["t"], values, str(file))
    notes = (*found.notes, *notes, *more)
    log = Log(str(file), poses, held, True, notes=notes, where=where, columns=kinds)
    wheels = found.command == ("left", "right")
    track = {"track": options.track} if wheels and options.track else {}
    log = replace(log, header_units=units, wheel_speeds=wheels, geometry=track)
    return correct(log, ReadOptions(units=units))


def read_commands(
    file: Path, options: ReadOptions
) -> tuple[Series, tuple[str, ...], tuple[str, ...]]:
    """Read a table of commands alone: what they are, and notes, beside it."""
    found, columns, where = _read_columns(file, options, poses=False)
    columns, where, notes = _whole_rows(columns, found, where)
    _check(file, columns, found, where, options.force)
    values, named, more = _commands(file, columns, found, options)
    held = Series(columns["t"], values, str(file))
    return in_units(held, named, _header_units(found, options)), named, (*notes, *more)


def _header_units(found: Found, options: ReadOptions) -> dict[str, str]:
    """Units that the header tells; what the user says goes first."""
    return {k: u for k, u in found.units.items() if k not in options.units}


def _whole_rows(
    columns: dict[str, Array], found: Found, where: Callable[[int], str]
) -> tuple[dict[str, Array], Callable[[int], str], tuple[str, ...]]:
    """Rows in which nothing is missing, how they are named, and a note on the others.

    Where most rows miss something, all are kept, and the check names the first.
    """
    lacking = {name: np.isnan(column) for name, column in columns.items()}
    kept = ~np.any(list(lacking.values()), axis=0)
    if kept.all() or 2 * int(kept.sum()) < len(kept):
        return columns, where, ()
    rows = np.flatnonzero(kept)
    names = ", ".join(found.shown(name) for name, missing in lacking.items() if missing.any())
    note = f"{len(kept) - len(rows)} rows without a number in {names} were left out"
    whole = {name: column[rows] for name, column in columns.items()}
    return whole, lambda row: where(int(rows[row]) if row >= 0 else row), (note,)


def _read_columns(
    file: Path, options: ReadOptions, poses: bool = True
) -> tuple[Found, dict[str, Array], Callable[[int], str]]:
    """Columns that are needed (n,) by our name, and how rows are named."""
    if file.suffix.lower() == ".npz":
        found, columns = _read_npz(file, options, poses)
        return found, columns, _row_of_array
    found, columns, layout = read_csv(file, options, poses)
    return found, columns, partial(_line_of_text, file, layout)


def _row_of_array(row: int) -> str:
    """Name a row of arrays; -1 is what holds the names."""
    return "arrays: " if row < 0 else row_number(row)


def _line_of_text(file: Path, layout: Layout, row: int) -> str:
    """Name a row of a text; -1 is its header."""
    return f"{layout.where}: " if row < 0 else line_of(file, row, layout)


def _poses(columns: dict[str, Array], found: Found, options: ReadOptions) -> Array:
    """Poses (n, 3); the heading of quaternions is that of the robot's x axis."""
    theta = columns.get("theta")
    if theta is None:
        theta = heading_of(*(columns[q] for q in QUATERNION))
    if "lat" in columns:
        place = _in_own_units(columns, ("lat", "lon"), found, options)
        north, east = local_metres(*place).T
        return np.column_stack([east, north, theta])
    return np.column_stack([columns["x"], columns["y"], theta])


def _commands(
    file: Path, columns: dict[str, Array], found: Found, options: ReadOptions
) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Commands (n, m), also of a left and a right wheel; what their numbers are, and notes."""
    if found.command != ("left", "right"):
        kinds, notes = found.command, list[str]()
        largest = {name: np.abs(columns[name]).max() for name in kinds}
        if "lateral" in kinds and largest["lateral"] < SIDEWAYS * largest["v"]:
            kinds = ("v", "omega")
            notes.append(f"{found.shown('lateral')} is next to nothing: this is no omni")
        elif "lateral" in kinds:
            notes.append('three speeds, an omni: wheels = {kind = "omni"}')
        return np.column_stack([columns[name] for name in kinds]), kinds, tuple(notes)
    if options.track is None:
        raise DataError(
            f"{file}: commands are speeds of a left and a right wheel: --track M tells how far "
            "apart they are"
        )
    sides = ("left", "right")
    left, right = _in_own_units(columns, sides, found, options)
    turning = [n for n in sides if {**found.units, **options.units}.get(n) in TURN_RATE]
    if turning and options.wheel_radius is None:
        raise DataError(
            f"{file}: {turning[0]} is in {({**found.units, **options.units})[turning[0]]}, the "
            "turns of a wheel: --wheel-radius M tells how large it is"
        )
    radius = {n: options.wheel_radius or 1.0 for n in turning}
    left, right = left * radius.get("left", 1.0), right * radius.get("right", 1.0)
    both = np.column_stack([0.5 * (left + right), (right - left) / options.track])
    return both, ("v", "omega"), ()


def _in_own_units(
    columns: dict[str, Array], names: tuple[str, ...], found: Found, options: ReadOptions
) -> list[Array]:
    """Columns that become others, in the units that the user gave, or the header."""
    units = parse_units({**found.units, **options.units})
    return [units[n].apply(columns[n]) if n in units else columns[n] for n in names]


def _read_npz(file: Path, options: ReadOptions, poses: bool) -> tuple[Found, dict[str, Array]]:
    """Columns from one array each."""
    try:
        names = read_npz(file, ())[1]
        found = find_columns(file, names, options.columns, "arrays", poses, options.units)
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
    if len(columns["t"]) < 2:
        raise DataError(f"{file}: {len(columns['t'])} row(s); expected at least 2")
    for name, column in columns.items():
        si = next((unit for unit, size in KNOWN.get(name, {}).items() if size == 1.0), "")
        unit = f" in {si}" if si and name not in found.units else ""
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


def _written_columns(episode: Episode) -> tuple[str, ...]:
    """Names by which a table tells a car's log, and an omni's."""
    *pose, v, omega = COLUMNS
    aside = ("lateral",) * (episode.inputs.shape[1] - INPUTS)
    return (*pose, v, *aside, CAR_OMEGA if episode.steered else omega)


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
    names = _written_columns(episodes[0])
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
                writer.writerow(names)
                for k in range(0, len(table), CHUNK):
                    writer.writerows(table[k : k + CHUNK].tolist())
                text.detach()
            else:
                np.savez_compressed(
                    out, allow_pickle=False, **dict(zip(names, table.T, strict=True))
                )
    except (OSError, ValueError) as error:
        raise DataError(
            f"{file}: cannot write the log: {getattr(error, 'strerror', None) or error}"
        ) from error
