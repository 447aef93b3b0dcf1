"""A study: axes, a drive of each combination and seed, a table; every drive a line of a file.

Rows depend on what is asked alone, and are the same to the last bit whatever runs them (but for the
step times in them, which a clock measures): joblib, in processes of this machine or on a Dask
cluster.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from kmpc_lite import __version__
from kmpc_lite.errors import DataError, KmpcError, ScenarioError
from kmpc_lite.reading import open_regular, read_bytes

if TYPE_CHECKING:
    from kmpc_lab.studies.drive import DriveResult

ANSWER = 10.0  # how long a cluster may take to answer, and to have a worker [s]
Run = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[Any]]
"""Calls a function with each tuple of arguments; gives what it returns, as it comes."""
REPORTING_SEED = 500_000  # seed from which on figures are reported; anything is tuned below it
MAX_BYTES = 2**28  # longest file of records that is read
Value = str | float | int
Asked = tuple[Any, ...]
"""What one drive is of: what the study needs to know, a value of each axis, and a seed."""


@contextmanager
def executor(workers: int | None = None, cluster: str | None = None) -> Iterator[Run]:
    """Start what runs a study.

    `workers`: processes on this machine; as many as it has cores if not given. `cluster`: address
    of a Dask scheduler (``tcp://host:8786``), which then does the work instead. An interrupt, or
    any error, ends its work at once. Raises KmpcError if Dask is not installed, no scheduler
    answers, it has no workers, or these have another version of this package; inside the block, if
    a worker is lost.
    """
    if cluster is None:
        with parallel_config("loky", inner_max_num_threads=1):
            yield _run(workers or -1)
        return
    with _client(cluster) as client, parallel_config("dask"):
        _check_workers(client, cluster)
        yield _run(-1)


def _run(workers: int) -> Run:
    def run(what: Callable[..., Any], each: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        parallel = Parallel(workers, return_as="generator_unordered", batch_size=1)
        try:
            yield from parallel(delayed(what)(*some) for some in each)
        except TerminatedWorkerError as error:
            raise KmpcError(
                "a worker process was killed, or ran out of memory: with --records rows that are "
                "done are kept, and --resume goes on; perhaps with fewer --workers"
            ) from error

    return run


def _client(address: str) -> Any:
    """Connect to a Dask scheduler."""
    try:
        from distributed import Client
    except ImportError as error:
        raise KmpcError(
            "--cluster: Dask is not installed: pip install 'kmpc-lab[cluster]'"
        ) from error
    try:
        return Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:
        raise KmpcError(
            f"--cluster {address}: no Dask scheduler answers within {ANSWER:g} s: {error}"
        ) from error


def _check_workers(client: Any, address: str) -> None:
    """Raise KmpcError unless there are workers that have this very version."""
    try:
        client.wait_for_workers(1, timeout=ANSWER)
    except TimeoutError as error:
        raise KmpcError(
            f"--cluster {address}: no worker within {ANSWER:g} s: start dask worker {address}"
        ) from error
    for worker, there in client.run(version, on_error="return").items():
        if there != __version__:
            raise KmpcError(
                f"--cluster {address}: worker {worker} has kmpc_lite {there}, "
                f"expected {__version__}"
            )


def version() -> str:
    """Version of this package where it is called."""
    return __version__


@dataclass(frozen=True)
class Axis:
    """What varies in a study."""

    values: tuple[Value, ...]
    text: str  # for its help
    usual: tuple[Value, ...] = ()  # what is driven if nothing is asked for; all if not given
    others: bool = False  # whether other values of the kind are driven, too

    def choose(self, option: str, words: Sequence[str] | None) -> tuple[Value, ...]:
        """Values that are asked for by beginnings or parts of their names, or by their numbers.

        Raises ScenarioError for a word that stands for no value.
        """
        if words is None:
            return self.usual or self.values
        found: dict[Value, None] = {}
        for word in words:
            exact = [value for value in self.values if str(value) == word]
            names = [value for value in self.values if isinstance(value, str)]
            begun = [name for name in names if name.lower().startswith(word.lower())]
            parts = [name for name in names if word.lower() in name.lower()]
            some = exact or self._number(word) or begun or parts
            if not some and self.others and isinstance(self.values[0], str):
                some = [word]
            if not some:
                among = "; ".join(map(str, self.values))
                raise ScenarioError(f"{option}: expected a part of one of {among}; got {word!r}")
            found |= dict.fromkeys(some)
        return tuple(found)

    def _number(self, word: str) -> list[Value]:
        """The number that a word is; none if it is no value of this axis."""
        try:
            number = float(word)
        except ValueError:
            return []
        fits: list[Value] = [v for v in self.values if not isinstance(v, str) and v == number]
        free = self.others and not isinstance(self.values[0], str) and 0.0 <= number < 1e3
        return fits or ([number] if free else [])


@dataclass(frozen=True)
class Study:
    """Who drives what, under which conditions, how often."""

    name: str
    text: str
    drive: str
    """``module:function`` of this folder: gives a `DriveResult` for what is `Asked`. The module has
    the table's ``COLUMNS``; it may have ``prepare(values)``, which is called before anything is
    driven and raises `KmpcError` for what is missing, and ``render(rows)`` for a table of its own.
    """
    axes: Mapping[str, Axis]
    drives: int  # seeds, if nothing else is asked for
    examples: tuple[str, ...]
    seed: int = REPORTING_SEED  # the first of them
    course: str = "map"  # what a seed draws
    versus: tuple[str, str] | None = None
    """Axis, and the value of it whose times the others' are compared with."""
    needs: Mapping[str, tuple[Callable[[str], Any], str]] = field(default_factory=dict)
    """Options without which nothing can be driven: what reads them, and their help."""

    def asked(
        self, values: Sequence[Sequence[Value]], seeds: Iterable[int], given: Sequence[Any] = ()
    ) -> list[Asked]:
        """Give all that is driven, in the order of the table."""
        return [(*given, *some) for some in product(*values, seeds)]

    def prepare(self, values: Sequence[Sequence[Value]]) -> None:
        """Raise `KmpcError` for what is missing, before hours of driving."""
        if (check := getattr(self._module, "prepare", None)) is not None:
            check(values)

    def render(self, rows: Sequence[DriveResult]) -> str:
        """Table of drives, for people."""
        from kmpc_lab.studies.table import beside, table

        if (own := getattr(self._module, "render", None)) is not None:
            return str(own(rows))
        columns = list(self._module.COLUMNS)
        if self.versus is not None:
            axis, value = list(self.axes).index(self.versus[0]), self.versus[1]
            if {row.axes[axis] for row in rows} > {value}:
                columns.append(beside(rows, axis, value))
        return table(rows, columns, self.course)

    @property
    def _module(self) -> Any:
        return import_module(f"kmpc_lab.studies.{self.drive.partition(':')[0]}")


def drive_one(study: Study, asked: Asked) -> tuple[Asked, DriveResult]:
    """What a worker does: the drive of what is asked, without its trace."""
    return asked, replace(drive_traced(study, asked), trace=None)


def drive_traced(study: Study, asked: Asked) -> DriveResult:
    """Drive one row, with what a picture needs."""
    module, _, name = study.drive.partition(":")
    drive = getattr(import_module(f"kmpc_lab.studies.{module}"), name)
    values = asked[len(study.needs) : -1]
    axes = tuple(value if isinstance(value, str) else f"{value:g}" for value in values)
    found: DriveResult = replace(drive(*asked), axes=axes, seed=asked[-1])
    return found


@dataclass(frozen=True)
class Work:
    """How a study runs: what does the work, who hears of it, and where its records stand."""

    run: Run  # of an `executor`
    progress: Callable[[int, int], None] = lambda done, total: None
    """Called with results there and results in all."""
    records: str | Path | None = None
    """JSON-lines file to which every result is added, and from which those already there are
    taken."""

    def rows(self, study: Study, wanted: Sequence[Asked]) -> list[DriveResult]:
        """Drive what the records do not hold yet; a row for each that is wanted, in this order.

        Raises DataError for a records file that is not this study's. Raises OSError if records
        cannot be written; before anything is driven.
        """
        every = {} if self.records is None else read_records(self.records, study.name)
        done = {asked: every[asked] for asked in wanted if asked in every}

        self.progress(len(done), len(wanted))
        missing = [(study, asked) for asked in wanted if asked not in done]
        for asked, row in self.run(drive_one, missing):
            done[asked] = row
            if self.records is not None:
                line = {"study": study.name, "asked": asked, "row": row.as_record()}
                with Path(self.records).open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line) + "\n")
            self.progress(len(done), len(wanted))
        return [done[asked] for asked in wanted]


def read_records(path: str | Path, study: str) -> dict[Asked, DriveResult]:
    """Read the rows of a study by what was asked; the file is made where it is missing.

    A last line that was cut off, as by a process that was killed while it wrote, is removed from
    the file.

    Raises DataError for a line that is no record of this study. Raises OSError if the file cannot
    be written.
    """
    from kmpc_lab.studies.drive import DriveResult

    source = Path(path)
    if source.exists():
        open_regular(source).close()  # what is none could not be added to
    source.open("a").close()
    text = read_bytes(source, MAX_BYTES).decode("utf-8", errors="replace")
    whole, _, cut_off = text.rpartition("\n")
    if cut_off:
        source.write_text(whole + "\n" if whole else "", encoding="utf-8")
    names, rows = {f.name for f in fields(DriveResult)} - {"trace"}, dict[Asked, DriveResult]()
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            record = json.loads(line)
            if record["study"] != study or set(record["row"]) != names:
                raise ValueError(study)
            rows[tuple(record["asked"])] = DriveResult.of_record(record["row"])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            raise DataError(
                f"{source}: line {number}: expected a drive of kmpc study {study}, "
                f"got {line[:60]!r}"
            ) from error
    return rows


def check_resume(path: str | Path | None, resume: bool) -> None:
    """Refuse to add to an earlier run's records by mistake.

    `path`: the records file that is asked for. `resume`: whether to go on from what it holds.
    Raises DataError: to go on without a file, or to start anew with a file that holds records.
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
