"""ArduPilot's .bin logs, streamed.

pymavlink's DFReader keeps an index of all messages, which grows with the log; here a block of the
file and four series are in memory.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.streams import (
    Thinned,
    counted_topics,
    held_together,
    local_metres,
    make_log,
    pick,
    steers,
    with_heading,
)
from kmpc_lite.learn.logs import Log, ReadOptions, Series
from kmpc_lite.reading import open_regular
from kmpc_lite.types import Array

BLOCK = 1 << 20
"""Bytes read at once."""
HEAD, FMT = b"\xa3\x95", 0x80
FORMAT = struct.Struct("<BB4s16s64s")
"""Type, length, name, letters and columns of a message that describes others."""
LETTERS: dict[str, tuple[str, float]] = {
    **{c: (c, 1.0) for c in "bBhHiIfdqQ"},
    **{"a": ("64s", 1.0), "n": ("4s", 1.0), "N": ("16s", 1.0), "Z": ("64s", 1.0), "M": ("B", 1.0)},
    **{"c": ("h", 0.01), "C": ("H", 0.01), "e": ("i", 0.01), "E": ("I", 0.01), "L": ("i", 1e-7)},
    "g": ("e", 1.0),
}
"""Letters of ArduPilot's formats: the letter of Python's struct, and the factor of the number."""
FIELDS = {
    "XKF1": ("PN", "PE", "Yaw"),
    "NKF1": ("PN", "PE", "Yaw"),
    "POS": ("Lat", "Lng"),
    "ATT": ("Yaw",),
    "THR": ("DesSpeed", "ThrOut"),
    "STER": ("DesTurnRate", "SteerOut"),
    "PARM": ("Name", "Value"),
}
"""What is read of which message; angles in degrees, turns to the right."""
FULL_STEERING = 4500.0
"""SteerOut of a robot that turns as fast as it can."""


@dataclass(frozen=True)
class Kind:
    """A message that is read."""

    name: str
    unpack: struct.Struct
    places: tuple[int, ...]
    """Where time, core and fields stand among the unpacked values; -1: nowhere."""
    scales: tuple[float, ...]


class _Formats:
    """Messages that a log has described so far."""

    def __init__(self) -> None:
        self.lengths = {FMT: 3 + FORMAT.size}
        self.kinds: dict[int, Kind] = {}
        self.names: dict[int, str] = {}

    def learn(self, body: bytes) -> None:
        """Take in a description; one that contradicts itself is left out."""
        number, length, raw_name, raw_letters, raw_columns = FORMAT.unpack(body)
        name, letters, columns = (
            raw.split(b"\0")[0].decode("ascii", "replace")
            for raw in (raw_name, raw_letters, raw_columns)
        )
        known = set(letters) <= LETTERS.keys() and name.isprintable()
        if number == FMT or length < 3 or not known:
            return
        # what was said of it before, of another length perhaps, holds no more
        self.kinds.pop(number, None)
        self.lengths[number], self.names[number] = length, name
        made = struct.Struct("<" + "".join(LETTERS[c][0] for c in letters))
        if name in FIELDS and made.size == length - 3:
            self.kinds[number] = _kind(name, made, letters, columns.split(","))


def _kind(name: str, made: struct.Struct, letters: str, columns: list[str]) -> Kind:
    """Where a message's values are."""
    stamp = "TimeUS" if "TimeUS" in columns else "TimeMS"
    wanted = (stamp, "C", *FIELDS[name])
    # text in a number's place is no number
    numbers = {
        column: place
        for place, (column, letter) in reversed(
            list(enumerate(zip(columns, letters, strict=False)))
        )
        if not LETTERS[letter][0].endswith("s") or (name, column) == ("PARM", "Name")
    }
    places = tuple(numbers.get(column, -1) for column in wanted)
    scales = tuple(LETTERS[letters[p]][1] if p >= 0 else 0.0 for p in places)
    return Kind(name, made, places, (1e-6 if stamp == "TimeUS" else 1e-3, *scales[1:]))


def messages(
    file: BinaryIO,
    counts: dict[str, int],
    settings: dict[str, float],
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[tuple[str, Any, list[float]]]:
    """Yield name, core, and time [s] with fields of the messages in `FIELDS`; count all others.

    Parameters are put into `settings`.

    Bytes that belong to no message are passed over: logs that were cut off, or sent by radio, have
    such bytes.
    """
    formats, data, at = _Formats(), b"", 0
    while True:
        left = len(data) - at
        length = formats.lengths.get(data[at + 2], 0) if left >= 3 else 3
        if left < max(length, 3):
            more = file.read(BLOCK)
            if not more:
                return
            if progress is not None:
                progress(file.tell(), os.fstat(file.fileno()).st_size)
            data, at = data[at:] + more, 0
            continue
        if data[at : at + 2] != HEAD or not length:
            found = data.find(HEAD, at + 1)
            at = found if found >= 0 else len(data) - 1
            continue
        number, body = data[at + 2], data[at + 3 : at + length]
        at += length
        if number == FMT:
            formats.learn(body)
            continue
        name = formats.names.get(number, "?")
        counts[name] = counts.get(name, 0) + 1
        if (kind := formats.kinds.get(number)) is not None:
            values = kind.unpack.unpack(body)
            if name == "PARM":
                parameter, value = (values[place] for place in kind.places[2:])
                if isinstance(parameter, bytes) and not isinstance(value, bytes):
                    settings[parameter.split(b"\0")[0].decode("ascii", "replace")] = value
                continue
            core = values[kind.places[1]] if kind.places[1] >= 0 else 0
            picked = (0, *range(2, len(kind.places)))
            yield (
                name,
                core,
                [
                    values[kind.places[k]] * kind.scales[k] if kind.places[k] >= 0 else np.nan
                    for k in picked
                ],
            )


def read_dataflash(path: Path, options: ReadOptions) -> Log:
    """Read poses of the EKF, or of the GPS, and commands: wanted speeds, or shares of the motors.

    Raises
    ------
    DataError
        If one of them is not logged.
    """
    counts: dict[str, int] = {}
    kept = {name: Thinned(len(fields), options.spacing) for name, fields in FIELDS.items()}
    cores: dict[str, Any] = {}
    settings: dict[str, float] = {}
    with open_regular(path) as file:
        begin = file.read(3)
        if begin[:2] != HEAD:
            got = begin.hex() or "nothing"
            raise DataError(f"{path}: not an ArduPilot log: it begins with {got}")
        file.seek(0)
        for name, core, (time, *values) in messages(file, counts, settings, options.progress):
            if cores.setdefault(name, core) == core and kept[name].wants(time):
                if np.isfinite([time, values[0]]).all():
                    kept[name].add(time, *values)
    rows = {name: samples.rows() for name, samples in kept.items() if samples.seen}
    source, poses = _poses(path, rows, options.topics, counts)
    commands, shares = _commands(path, rows, options.topics, counts)
    topics = counted_topics("DataFlash", dict(sorted(counts.items())), poses[:, 0])
    where = f"{source} (north, east, yaw)"
    return make_log(path, poses, where, commands, shares, topics, steers(settings))


def _seen(counts: Mapping[str, int]) -> str:
    """Names of messages, as many as fit a line."""
    return ", ".join(sorted(counts)[:12])


def _poses(
    path: Path, rows: Mapping[str, Array], chosen: Mapping[str, str], counts: Mapping[str, int]
) -> tuple[str, Array]:
    """Source, and time, north, east and yaw of poses (n, 4)."""
    there = [n for n in ("XKF1", "NKF1") if len(rows.get(n, ())) > 1]
    if len(rows.get("POS", ())) > 1 and len(rows.get("ATT", ())) > 1:
        there.append("POS")
    name = pick(path, "odom", chosen, there, f"{_seen(counts)}")
    if name == "POS":
        metres = local_metres(rows["POS"][:, 1], rows["POS"][:, 2])
        where = np.column_stack([rows["POS"][:, 0], metres])
        turned = np.column_stack([rows["ATT"][:, 0], np.radians(rows["ATT"][:, 1])])
        found = with_heading(where, turned)
    else:
        found = rows[name].copy()
        found[:, 3] = np.radians(found[:, 3])
    return name, found


def _commands(
    path: Path, rows: Mapping[str, Array], chosen: Mapping[str, str], counts: Mapping[str, int]
) -> tuple[Series, bool]:
    """Commands, turns to the left positive, and whether they are shares of what motors can do."""
    there = []
    if all(len(rows.get(n, ())) > 1 for n in ("THR", "STER")):
        moving = [np.nan_to_num(rows[n][:, 1]).any() for n in ("THR", "STER")]
        there = ["desired", "output"] if all(moving) else ["output"]
    name = pick(path, "cmd", chosen, there, f"{_seen(counts)}; THR and STER hold commands")
    desired = name == "desired"
    field = 1 if desired else 2
    both = held_together(rows["THR"][:, [0, field]], rows["STER"][:, [0, field]])
    if desired:
        values = np.column_stack([both[:, 1], -np.radians(both[:, 2])])
        return Series(both[:, 0], values, "THR.DesSpeed, STER.DesTurnRate"), False
    full = FULL_STEERING if np.abs(both[:, 2]).max() > 1.5 else 1.0
    values = np.column_stack([both[:, 1] / 100.0, -both[:, 2] / full])
    return Series(both[:, 0], values, "THR.ThrOut, STER.SteerOut"), True
