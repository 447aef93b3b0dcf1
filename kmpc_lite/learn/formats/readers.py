"""Which reader reads which file; a missing package is reported before anything is read."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.learn.formats.columns import STEERED
from kmpc_lite.learn.formats.mcap import DRIVE, is_ours
from kmpc_lite.learn.logs import LARGEST, Log, ReadOptions, correct
from kmpc_lite.learn.steering import as_car
from kmpc_lite.reading import open_regular


class Reader(NamedTuple):
    """What reads one format, and what it needs."""

    where: str  # ``module:function`` within this folder
    what: str  # name of the format
    needs: str = ""  # module that it needs beside the core's, which the extra "logs" brings


TABLE = Reader("tables:read_table", "a table")
BAG = Reader("rosbag:read_bag", "a ROS bag", "rosbags")
RECORDED = Reader("mcap:read_recorded", "a drive that kmpc recorded", "mcap")
READERS: dict[str, Reader] = {
    **dict.fromkeys((".csv", ".npz", ".tsv", ".txt", ".tum"), TABLE),
    **dict.fromkeys((".bag", ".mcap", ".db3"), BAG),
    ".bin": Reader("ardupilot:read_dataflash", "an ArduPilot log", "pymavlink"),
    ".tlog": Reader("ardupilot:read_tlog", "a MAVLink log", "pymavlink"),
    ".ulg": Reader("ulog:read_ulog", "a PX4 log", "pyulog"),
}
LFS = b"version https://git-lfs"  # what Git leaves in place of a large file
MAGIC = {
    b"\x89MCAP0\r\n": ".mcap",
    b"#ROSBAG": ".bag",
    b"SQLite format 3": ".db3",
    b"\xa3\x95\x80\x80": ".bin",
    b"ULog\x01\x12\x35": ".ulg",
    b"PK\x03\x04": ".npz",
}
"""First bytes of files whose ending says nothing."""


def read_log(path: str | os.PathLike[str], options: ReadOptions | None = None) -> Log:
    """Read one file, or a folder that is a rosbag2, in SI units and x east, y north.

    Raises DataError for whatever is wrong, in one line that names the file.
    """
    options = ReadOptions() if options is None else options
    file = Path(path)
    if _first_bytes(file).startswith(LFS):
        raise DataError(f"{file}: a pointer of Git LFS, not the log itself: git lfs pull gets it")
    reader = reader_of(file)
    _need(file, reader)
    if options.commands is not None and reader is not TABLE:
        raise DataError(f"{file}: --commands goes with tables of poses; this is {reader.what}")
    module, _, name = reader.where.partition(":")
    read: Callable[[Path, ReadOptions], Log] = getattr(
        import_module(f"kmpc_lite.learn.formats.{module}"), name
    )
    try:
        log = correct(_usable(read(file, options), options), options)
        return _steered(log, options) if log.columns[1] in STEERED else log
    except DataError:
        raise
    except (OSError, ValueError, OverflowError) as error:
        raise DataError(
            f"{file}: cannot read the log: {getattr(error, 'strerror', None) or error}"
        ) from error


def _steered(log: Log, options: ReadOptions) -> Log:
    """A car's log; where its steering explains no turns, what else of it is not as it should be."""
    try:
        return as_car(log, options.wheelbase)
    except DataError as error:
        from kmpc_lite.learn.checks import judge

        straight = replace(log.commands, values=log.commands.values * (1.0, 0.0))
        suspects = judge(replace(log, commands=straight)).suspects
        raise DataError(f"{log.name}: {(*suspects, error)[0]}") from error


def _usable(log: Log, options: ReadOptions) -> Log:
    """A log whose samples are all finite, of the size of poses and commands, and in order.

    Tables have been checked line by line; of streams single samples are left out.
    """
    if log.together:
        return log
    parts, left_out = [], 0
    for series in (log.poses, log.commands):
        good = np.isfinite(series.time) & (np.abs(series.values) < LARGEST).all(axis=1)
        left_out += int((~good).sum())
        time = series.time[good]
        if len(time) < 2:
            raise DataError(f"{log.name}: {series.source}: {len(time)} sample(s); expected 2")
        if (back := np.diff(time) < 0.0).any() and not options.force:
            at = int(np.argmax(back))
            raise DataError(
                f"{log.name}: {series.source}: the clock steps back by "
                f"{time[at] - time[at + 1]:.6g} s at {time[at]:.15g} s; --force cuts the log there"
            )
        parts.append(replace(series, time=time, values=series.values[good]))
    notes = (f"{left_out} samples that are no numbers were left out",) if left_out else ()
    return replace(log, poses=parts[0], commands=parts[1], notes=(*log.notes, *notes))


def find_logs(paths: Iterable[str | os.PathLike[str]]) -> list[Path]:
    """Files and bags that are meant: a folder that is no bag means the logs in it.

    Raises DataError for a folder without logs, an unknown ending, and a reader that is not
    installed.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir() or _is_bag(path):
            found.append(path)
        elif is_ours(path / DRIVE):  # what lies beside it holds the same drive
            found.append(path / DRIVE)
        else:
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in READERS or _is_bag(p))
            if not inside and path.suffix.lower() not in READERS:
                raise DataError(f"{path}: a folder without a log; expected {ENDINGS}")
            found += inside or [path]
    for file in found:
        _need(file, reader_of(file))
    return found


def refuse_unused(files: Iterable[Path], options: ReadOptions) -> None:
    """Refuse options that none of the logs can heed.

    Raises DataError: names the option.
    """
    tables = {reader_of(file) is TABLE for file in files}
    if options.columns and True not in tables:
        raise DataError("--columns: none of the logs is a table; --topics chooses of the others")
    if options.topics and False not in tables:
        raise DataError("--topics: all of the logs are tables; --columns chooses of those")


def _is_bag(path: Path) -> bool:
    """Whether a folder is a rosbag2."""
    return (path / "metadata.yaml").is_file()


ENDINGS = ", ".join(READERS) + " or a rosbag2 folder"


def reader_of(file: Path) -> Reader:
    """Choose by the ending, or by the first bytes where the ending says nothing."""
    if _is_bag(file):
        return BAG
    ending = file.suffix.lower()
    if READERS.get(ending) is BAG and is_ours(file):
        return RECORDED
    if ending in READERS:
        return READERS[ending]
    begin = _first_bytes(file)
    for magic, known in MAGIC.items():
        if begin.startswith(magic):
            return READERS[known]
    hint = did_you_mean(ending, READERS) if len(ending) > 2 else ""
    raise DataError(
        f"{file}: unknown log format {file.suffix or '(no ending)'!r}; expected {ENDINGS}{hint}"
    )


def _first_bytes(file: Path) -> bytes:
    """The first bytes of a regular file; none if there is no such file."""
    try:
        with open_regular(file) as opened:
            return opened.read(len(LFS))
    except OSError:
        return b""


def _need(file: Path, reader: Reader) -> None:
    """Refuse where what a format needs is not installed, with the line that installs it."""
    try:
        missing = bool(reader.needs) and find_spec(reader.needs) is None
    except ImportError:
        missing = True
    if missing:
        raise DataError(
            f"{file}: {reader.what} needs {reader.needs}: pip install 'kmpc-lite[logs]'"
        )
