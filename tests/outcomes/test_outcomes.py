"""A tenth of the outcome drives in ``make test``, all of them in ``make test-long``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from outcomes import judge
from outcomes.bits import first_difference
from outcomes.files import EXPECTED, line_of, read, to_text
from outcomes.loop import Result
from outcomes.rows import ROWS
from outcomes.runner import chosen, drive_key

EXPECTATIONS = read()


def complaints(name: str) -> list[str]:
    """Drive a row; why it is worse than recorded."""
    result = drive_key((name, 0, 0)).result
    if result is None:
        return []
    plot = f'; see it: PYTHONPATH=.:lab:tests python -m outcomes plot "{name}"'
    return [c + plot for c in judge.complaints(EXPECTATIONS[name, 0], line_of([result]))]


@pytest.mark.parametrize("name", [row.name for row in chosen(quick=True)])
def test_a_drive_is_as_good_as_recorded(name: str) -> None:
    assert complaints(name) == []


@pytest.mark.long
def test_all_drives_are_as_good_as_recorded(capsys: pytest.CaptureFixture[str]) -> None:
    from outcomes.__main__ import main

    status = main(["check"])
    assert status == 0, capsys.readouterr().out


def test_every_row_is_recorded_and_nothing_else() -> None:
    assert {name for name, _ in EXPECTATIONS} == set(ROWS)


def test_expectations_are_read_as_they_were_written(tmp_path: Path) -> None:
    text = EXPECTED.read_text(encoding="utf-8")
    written = tmp_path / "results.csv"
    written.write_text(to_text(EXPECTATIONS.values()), encoding="utf-8")
    lines = [[row for row in t.splitlines() if row[0] != "#"] for t in (text, written.read_text())]
    assert lines[0] == lines[1]


def test_the_drives_come_to_every_status_and_every_end() -> None:
    found = [line.result for line in EXPECTATIONS.values()]
    for status in ("stopped", "fallback", "feasible"):
        assert max(getattr(result, status) for result in found) > 0.1
    ends = set().union(*(line.ends for line in EXPECTATIONS.values()))
    assert ends - {"holding"} == {"arrived", "driving", "unreachable", "waiting"}


GOOD = Result("a", "b", 0, 0.0, "arrived", 10.0, 0.4, 1, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.1)


@pytest.mark.parametrize(
    ("worse", "word"),
    [
        ({"contacts": 1, "depth": 0.1}, "contacts: expected 0, got 1"),
        ({"ended": "waiting"}, "expected arrived, got waiting"),
        ({"time": 10.6}, "time: expected at most 10.50 s, got 10.60 s"),
        ({"clearance": 0.2}, "clearance: expected at least 0.30 r"),
        ({"gears": 3}, "gears: expected at most 2"),
        ({"stopped": 0.1}, "STOPPED: expected at most 5 %, got 10 %"),
        ({"chatter": 0.2}, "chatter: expected at most 15 %, got 20 %"),
        ({"faults": "step 3: out of bounds"}, "expected no fault"),
    ],
)
def test_what_is_worse_is_told_in_words(worse: dict[str, object], word: str) -> None:
    old, new = line_of([GOOD]), line_of([Result(**{**vars(GOOD), **worse})])
    assert judge.complaints(old, old) == []
    (found,) = judge.complaints(old, new)
    assert word in found


def test_a_chaotic_row_has_a_wider_band() -> None:
    twin = Result(**{**vars(GOOD), "time": 11.0})
    late = line_of([Result(**{**vars(GOOD), "time": 12.0})])
    assert judge.complaints(line_of([GOOD]), late)
    assert judge.complaints(line_of([GOOD, twin]), late) == []


def test_the_first_step_that_differs_by_a_bit() -> None:
    one = np.zeros((5, 2))
    other = one.copy()
    assert first_difference(one, other) is None
    other[3, 1] = -0.0
    assert first_difference(one, other) == 3
    assert first_difference(one, one[:4]) == 4


@pytest.mark.parametrize(
    "name",
    [
        "masts on the robot were followed as walkers",
        "crossing circles, map 0",
        "'update refused' for a second and a half",
        "a robot that lags, dense map",
    ],
)
def test_a_drive_driven_again_is_the_same_to_the_last_bit(name: str) -> None:
    once, again = (drive_key((name, 0, 0)).commands for _ in range(2))
    assert len(once) and first_difference(once, again) is None
