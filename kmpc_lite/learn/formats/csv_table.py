"""Tables of text: CSV of any delimiter, with a header; and TUM trajectories, which have none."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.episode import MAX_ROWS
from kmpc_lite.learn.formats.columns import COLUMNS, Found, find_columns, short
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.reading import text_lines
from kmpc_lite.types import Array

MAX_HEADER = 10_000
"""Characters of the longest first line that is looked at."""
MAX_LINE = 100_000
"""Characters of the longest line: a file without line ends is no table."""
MAX_REMARKS = 100
"""Lines before the header that begin with # and are no header."""
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


@dataclass(frozen=True)
class Layout:
    """How the text of a table is to be read."""

    header: list[str]
    delimiter: str | None
    """What parts the values of a line; None stands for blanks."""
    skipped: int
    """Lines before the first row."""
    first: str
    """The line that was taken for the first row if there is no header, or nothing."""
    where: str
    """What messages call the header."""

    def values(self, line: str) -> list[str]:
        """Values of one line; quotes may hold delimiters."""
        if self.delimiter is None:
            return line.split()
        try:
            return next(csv.reader([line], delimiter=self.delimiter), [])
        except csv.Error:  # a value of more than 100,000 characters
            return line.split(self.delimiter)


def read_csv(
    file: Path, options: ReadOptions, poses: bool = True
) -> tuple[Found, dict[str, Array], Layout]:
    """Read the columns of a text table that are needed.

    Returns
    -------
    tuple
        Which columns they are, their values (n,) by our name, and how the text is laid out.
    """
    try:
        return _read(file, options, poses, tolerant=False)
    except DataError:
        raise
    except ValueError:  # values are missing, times are dates, or something is wrong
        return _read(file, options, poses, tolerant=True)


def _read(
    file: Path, options: ReadOptions, poses: bool, tolerant: bool
) -> tuple[Found, dict[str, Array], Layout]:
    """Read the columns; a table in which every value is a number takes a tenth of the time."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        layout = _layout(file, lines)
        found = find_columns(
            file, layout.header, options.columns, layout.where, poses, options.units
        )
        rows = _rows(file, lines, layout)
        first = next(rows, None)
        if first is None:
            return found, {name: np.empty(0) for name in found.where}, layout
        convert: dict[int | str, Callable[[str], float]] = {}
        if tolerant:
            convert.update({place: parse_number for place in found.where.values()})
            convert[found.where["t"]] = parse_time
        try:
            table = np.loadtxt(
                chain([first], rows),
                delimiter=layout.delimiter,
                usecols=list(found.where.values()),
                ndmin=2,
                comments=None,
                quotechar='"',
                converters=convert or None,
                encoding="utf-8",
            )
        except DataError:
            raise
        except ValueError as error:
            if not tolerant:
                raise
            raise DataError(f"{file}: {_bad_value(file, layout, found) or error}") from error
    columns = dict(zip(found.where, table.T, strict=True))
    if "t" not in found.units and np.median(columns["t"]) > EPOCH_NANOSECONDS:
        found = replace(found, units={**found.units, "t": "ns"})
    return found, columns, layout


def parse_number(text: str) -> float:
    """Read a number; NaN if it is missing."""
    bare = text.strip()
    if bare.lower() in MISSING:
        return float("nan")
    if not is_number(bare):
        raise ValueError(bare)
    return float(bare)


def parse_time(text: str) -> float:
    """Read a number, or a date and a time as ISO 8601 has them, as seconds since 1970."""
    try:
        return parse_number(text)
    except ValueError:
        when = datetime.fromisoformat(text.strip())
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
        if _is_tum(line):
            return Layout(list(TUM), None, number - 1, line, f"line {number}")
        remark = line.lstrip().startswith("#")
        layout = _header(line.lstrip().lstrip("#%") if remark else line, number)
        if not remark or _is_time(line.lstrip(" #%")):
            return layout
    raise DataError(f"{file}: {MAX_REMARKS} lines of remarks; expected {','.join(COLUMNS)}")


def _is_time(remark: str) -> bool:
    """Whether a remark begins as a header does: EuRoC's with #timestamp [ns]."""
    return re.match(r"(t|time|stamp|timestamp)\b", remark.lower()) is not None


def _is_tum(line: str) -> bool:
    """Whether a line is a pose of a TUM trajectory."""
    values = line.split()
    return len(values) == len(TUM) and all(is_number(v) for v in values)


def _header(line: str, number: int) -> Layout:
    """Names of the columns, parted by what parts most of them."""
    text = line.strip().lstrip("%")
    most = max(DELIMITERS, key=text.count)
    delimiter = most if most in text else None
    values = Layout([], delimiter, number, "", "").values(line.strip("\r\n").lstrip("%"))
    names = [name.strip() for name in values]
    return Layout(names, delimiter, number, "", f"line {number}: header")


def _rows(file: Path, lines: Iterator[str], layout: Layout) -> Iterator[str]:
    """Yield the lines that are not blank; each must have as many values as the header."""
    width, delimiter, rows = len(layout.header), layout.delimiter, 0
    decimal_comma = delimiter == ";"
    begin = chain([layout.first], lines) if layout.first else lines
    for number, line in enumerate(begin, layout.skipped + 1):
        quoted = '"' in line
        if quoted and line.count('"') % 2:
            raise DataError(f"{file}: line {number}: a quote without its end")
        if delimiter is None or quoted or line.count(delimiter) != width - 1:
            if not line.strip() or (delimiter is None and line.lstrip().startswith("#")):
                continue
            if (count := len(layout.values(line))) != width:
                raise DataError(
                    f"{file}: line {number}: expected {width} values as in the header, got {count}"
                )
        rows += 1
        if rows > MAX_ROWS:
            raise DataError(
                f"{file}: more than {MAX_ROWS:,} rows; "
                "cut the log into files and join their datasets"
            )
        yield line.replace(",", ".") if decimal_comma else line


def _bad_value(file: Path, layout: Layout, found: Found) -> str | None:
    """Find the first value that is no number: its line, column and text."""
    with closing(text_lines(file, MAX_LINE)) as lines:
        for number, line in islice(enumerate(lines, 1), layout.skipped, None):
            values = layout.values(line)
            for name, place in found.where.items() if line.strip() else ():
                text = values[place].strip() if place < len(values) else ""
                parse = parse_time if name == "t" else parse_number
                try:
                    parse(text.replace(",", ".") if layout.delimiter == ";" else text)
                except ValueError:
                    told = f"expected a number, got {short(text)!r}"
                    return f"line {number}, column {found.shown(name)}: {told}"
    return None


def is_number(text: str) -> bool:
    """Whether NumPy reads it: Python takes 1_000 and other scripts' digits too."""
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text


def line_of(file: Path, row: int, layout: Layout) -> str:
    """Name a row as its file does: lines count from 1, with remarks, header and blank lines."""
    first = layout.skipped
    with closing(text_lines(file, MAX_LINE)) as lines:
        numbers: Iterator[int] = (
            number
            for number, line in enumerate(lines, 1)
            if number > first
            and line.strip()
            and not (layout.delimiter is None and line.lstrip().startswith("#"))
        )
        return f"line {next(islice(numbers, row, None), row + 1 + first)}"


def joined(columns: dict[str, Array], names: Sequence[str]) -> Array:
    """Columns side by side, (n, k)."""
    return np.column_stack([columns[name] for name in names])
