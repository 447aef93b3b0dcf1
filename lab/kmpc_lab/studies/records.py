"""Lines of JSON to which a study adds what was driven, and from which it goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from kmpc_lab.studies.executors import gather
from kmpc_lite.errors import DataError
from kmpc_lite.reading import open_regular, read_bytes

MAX_BYTES = 2**28
"""Longest file of records that is read."""
Record = dict[str, Any]
"""What was driven, in plain values."""
Row = TypeVar("Row")
"""What became of a drive."""


@dataclass(frozen=True)
class RecordFile:
    """Records of one study in a file; without a path nothing is read or kept.

    Parameters
    ----------
    path : Path or str, optional
        The file (.jsonl); it is made where it is missing.
    key : callable
        What makes a record one and the same; raises ValueError, KeyError or TypeError for
        anything but a record of this study.
    what : str
        What a line of the file is called in an error.
    """

    path: str | Path | None
    key: Callable[[Record], Hashable]
    what: str

    def read(self) -> dict[Hashable, Record]:
        """Give the records by their keys.

        A last line that was cut off, as by a process that was killed while it wrote, is removed
        from the file.

        Raises
        ------
        DataError
            For a line that is no record of this study.
        OSError
            Where the file cannot be written; before anything is driven.
        """
        if self.path is None:
            return {}
        source = Path(self.path)
        if source.exists():
            open_regular(source).close()  # what is none could not be added to
        source.open("a").close()
        text = read_bytes(source, MAX_BYTES).decode("utf-8", errors="replace")
        whole, _, cut_off = text.rpartition("\n")
        if cut_off:
            source.write_text(whole + "\n" if whole else "", encoding="utf-8")
        records: dict[Hashable, Record] = {}
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                record = json.loads(line)
                records[self.key(record)] = record
            except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                raise DataError(
                    f"{source}: line {number}: expected {self.what}, got {line[:60]!r}"
                ) from error
        return records

    def add(self, records: Iterable[Record]) -> None:
        """Append records, whole lines at once."""
        if self.path is not None:
            with Path(self.path).open("a", encoding="utf-8") as file:
                file.write("".join(json.dumps(record) + "\n" for record in records))


def drive_all(
    executor: Executor,
    file: RecordFile,
    drive: Callable[..., Record],
    wanted: Sequence[tuple[Any, ...]],
    progress: Callable[[int, int], None],
) -> list[Record]:
    """Drive what the file does not hold yet; one record for each that is wanted, in this order.

    Parameters
    ----------
    executor : Executor
        Does the work.
    file : RecordFile
        Every drive is added to it; its keys are what is wanted.
    drive : callable
        What a worker does: it is given a key's items.
    wanted : sequence of tuple
        Keys.
    progress : callable
        Called with drives done and drives in all.
    """
    asked = set[Hashable](wanted)
    done = {key: record for key, record in file.read().items() if key in asked}

    def keep(record: Record) -> None:
        done[file.key(record)] = record
        file.add([record])
        progress(len(done), len(wanted))

    progress(len(done), len(wanted))
    gather({executor.submit(drive, *key): keep for key in wanted if key not in done})
    return [done[key] for key in wanted]


def drive_rows(
    executor: Executor,
    path: str | Path | None,
    study: str,
    drive: Callable[..., Any],
    wanted: Sequence[tuple[Any, ...]],
    row: type[Row],
    progress: Callable[[int, int], None],
) -> list[Row]:
    """Drive what a study asks for; a row for each drive, in this order.

    Parameters
    ----------
    executor : Executor
        Does the work.
    path : Path or str, optional
        Records: ``study``, what was ``asked``, and the ``row`` in plain values.
    study : str
        What the records belong to.
    drive : callable
        What a worker does: it is given what is asked, and gives a row, whose `as_dict` gives plain
        values.
    wanted : sequence of tuple
        What is asked: words and numbers.
    row : type
        Dataclass of the rows: made from those plain values.
    progress : callable
        Called with drives done and drives in all.
    """
    file = RecordFile(path, partial(_asked, study, row), f"a drive of kmpc study {study}")
    records = drive_all(executor, file, partial(_driven, study, drive), wanted, progress)
    return [row(**record["row"]) for record in records]


def _asked(study: str, row: type, record: Record) -> Hashable:
    """What was asked for; ValueError for what is no record of this study."""
    told = set(record["row"])
    if record["study"] != study or told != {field.name for field in fields(row)}:
        raise ValueError(study)
    return tuple(record["asked"])


def _driven(study: str, drive: Callable[..., Any], *asked: Any) -> Record:
    return {"study": study, "asked": list(asked), "row": drive(*asked).as_dict()}


def check_resume(path: str | Path | None, resume: bool) -> None:
    """Refuse to add to an earlier run's records by mistake.

    Parameters
    ----------
    path : Path or str, optional
        The records file that is asked for.
    resume : bool
        Whether to go on from what it holds.

    Raises
    ------
    DataError
        To go on without a file, or to start anew with a file that holds records.
    """
    if path is None:
        if resume:
            raise DataError("--resume: expected --records FILE, the records to go on from")
        return
    found = Path(path)
    if not resume and found.is_file() and found.stat().st_size:
        raise DataError(
            f"{found}: holds records of an earlier run: --resume goes on from them, "
            "another file keeps them"
        )
