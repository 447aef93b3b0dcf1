"""Lines of JSON to which a study adds what was driven, and from which it goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from kmpc_lab.studies.executors import gather
from kmpc_lab.studies.training import Lesson, Teacher
from kmpc_lite.errors import DataError
from kmpc_lite.reading import open_regular, read_bytes

MAX_BYTES = 2**28
"""Longest file of records that is read."""
Record = dict[str, Any]
"""What was driven, in plain values."""
Job = tuple[Future[Any], Callable[[Any], list[Record]]]
"""What is under way, and what makes records of its result."""
Key = TypeVar("Key", bound=Hashable)
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
            If the file cannot be written; before anything is driven.
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


@dataclass(frozen=True)
class Work:
    """How a study runs: what does the work, who hears of it, and where its records stand."""

    executor: Executor
    """Its workers must be able to import this package."""
    progress: Callable[[int, int], None] = lambda done, total: None
    """Called with results there and results in all; a model that is learned counts as one."""
    records: str | Path | None = None
    """JSON-lines file to which every result is added, and from which those already there are
    taken."""

    def finish(
        self,
        wanted: Iterable[Key],
        key: Callable[[Record], Hashable],
        what: str,
        jobs: Callable[[Sequence[Key]], Iterable[Job]],
        teacher: Teacher | None = None,
        lesson: Callable[[Key], Lesson | None] = lambda key: None,
    ) -> list[Record]:
        """Do what the records do not hold yet; one record for each that is wanted, in this order.

        Parameters
        ----------
        wanted : iterable
            Keys.
        key, what
            As `RecordFile` takes them.
        jobs : callable
            Starts what is missing: gives futures, each with what makes records of its result.
        teacher, lesson : Teacher, callable, optional
            Learns, before anything else is started, what a key's drive needs.
        """
        file, keys = RecordFile(self.records, key, what), list(wanted)
        asked = set[Hashable](keys)
        done = {key: record for key, record in file.read().items() if key in asked}
        missing = [key for key in keys if key not in done]
        lessons = [] if teacher is None else teacher.new(map(lesson, missing))
        finished, total = len(done), len(keys) + len(lessons)

        def count(more: int = 1) -> None:
            nonlocal finished
            finished += more
            self.progress(finished, total)

        def keep(told: Callable[[Any], list[Record]], result: Any) -> None:
            found = told(result)
            done.update((key(record), record) for record in found)
            file.add(found)
            count(len(found))

        count(0)
        if teacher is not None:
            teacher.learn(lessons, count)
        gather({future: partial(keep, told) for future, told in jobs(missing)})
        return [done[key] for key in keys]

    def drive(
        self,
        wanted: Iterable[tuple[Any, ...]],
        drive: Callable[..., Record],
        key: Callable[[Record], Hashable],
        what: str,
    ) -> list[Record]:
        """Call a function in the workers, with each key's items, for the record of that key."""

        def jobs(missing: Sequence[tuple[Any, ...]]) -> Iterable[Job]:
            return [(self.executor.submit(drive, *key), lambda record: [record]) for key in missing]

        return self.finish(wanted, key, what, jobs)

    def rows(
        self,
        study: str,
        wanted: Iterable[tuple[Any, ...]],
        drive: Callable[..., Any],
        row: type[Row],
    ) -> list[Row]:
        """Drive what a study asks for; a row for each drive, in this order.

        Its records hold ``study``, what was ``asked``, and the ``row`` in plain values.

        Parameters
        ----------
        study : str
            What the records belong to.
        wanted : iterable of tuple
            What is asked: words and numbers.
        drive : callable
            What a worker does: it is given what is asked, and gives a row.
        row : type
            Dataclass of the rows, of plain values.
        """
        what, key = f"a drive of kmpc study {study}", partial(_asked, study, row)
        records = self.drive(wanted, partial(_driven, study, drive), key, what)
        return [row(**record["row"]) for record in records]


def _asked(study: str, row: type, record: Record) -> Hashable:
    """What was asked for; ValueError for what is no record of this study."""
    told = set(record["row"])
    if record["study"] != study or told != {field.name for field in fields(row)}:
        raise ValueError(study)
    return tuple(record["asked"])


def _driven(study: str, drive: Callable[..., Any], *asked: Any) -> Record:
    return {"study": study, "asked": list(asked), "row": asdict(drive(*asked))}


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
