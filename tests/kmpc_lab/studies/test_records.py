"""Records of a study: kept line by line, read back, and never added to by mistake."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

import kmpc_lite as kl
from kmpc_lab.studies.records import RecordFile, Work, check_resume
from kmpc_lite.errors import DataError


def file(path: Path | None) -> RecordFile:
    return RecordFile(path, lambda record: record["name"], "a thing")


def test_an_earlier_runs_records_are_gone_on_from_only_when_asked(tmp_path: Path) -> None:
    path = tmp_path / "some.jsonl"
    check_resume(path, False)
    check_resume(path, True)  # nothing there yet: a study that restarts itself may say so at once
    check_resume(None, False)
    path.write_text('{"name": "a"}\n')
    check_resume(path, True)
    with pytest.raises(kl.DataError, match="holds records of an earlier run: --resume goes on"):
        check_resume(path, False)
    with pytest.raises(kl.DataError, match="--resume: expected --records FILE"):
        check_resume(None, True)


@dataclass(frozen=True)
class Thrown:
    """A row of a study that throws dice."""

    die: str
    seed: int
    clearance: float


def throw(die: str, seed: int) -> Thrown:
    return Thrown(die, seed, math.inf)


def test_rows_are_kept_and_only_what_is_missing_is_driven(tmp_path: Path) -> None:
    file, told = tmp_path / "dice.jsonl", list[tuple[int, int]]()

    def throws(study: str, *asked: tuple[str, int]) -> list[Thrown]:
        with ThreadPoolExecutor(1) as executor:
            note = lambda *progress: told.append(progress)  # noqa: E731
            return Work(executor, note, file).rows(study, asked, throw, Thrown)

    first = throws("dice", ("red", 1), ("blue", 1))
    assert first == [throw("red", 1), throw("blue", 1)] and told[-1] == (2, 2)
    told.clear()
    assert throws("dice", ("blue", 1), ("red", 2)) == [throw("blue", 1), throw("red", 2)]
    assert told == [(1, 2), (2, 2)]
    assert len(file.read_text().splitlines()) == 3
    with pytest.raises(DataError, match="line 1: expected a drive of kmpc study coins, got"):
        throws("coins", ("red", 1))
    file.write_text('{"study": "dice", "asked": ["red", 1], "row": {"die": "red"}}\n')
    with pytest.raises(DataError, match="line 1: expected a drive of kmpc study dice"):
        throws("dice", ("red", 1))
