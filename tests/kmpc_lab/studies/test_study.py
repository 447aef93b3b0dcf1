"""The runner of studies: what is asked for, records kept line by line, and tables."""

import math
from dataclasses import replace
from itertools import starmap
from pathlib import Path

import pytest

import kmpc_lite as kl
from kmpc_lab.sim.maps import FAMILIES
from kmpc_lab.studies import robot_drives
from kmpc_lab.studies.catalogue import STUDIES
from kmpc_lab.studies.contenders import STUDY_CONTENDERS
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.hard import ROWS as HARD
from kmpc_lab.studies.limits import ROBOTS as LIMITS
from kmpc_lab.studies.maps import CONDITIONS
from kmpc_lab.studies.parking import KINDS, KINDS_OF_CARS
from kmpc_lab.studies.real import RECIPES
from kmpc_lab.studies.study import Work, check_resume
from kmpc_lab.studies.table import AT_LEAST, DRIVES, TIME, beside, table
from kmpc_lite.errors import DataError, ScenarioError

SCALES = STUDIES["scales"]
HALF = (("arrived", True), ("collided", False), ("seconds", 10.0), ("ideal_seconds", 8.0))
REST = ("clearance", "fastest", "jerk", "stopped", "fallback", "feasible", "step_p50", "step_p99")
ROW = DriveResult(
    **dict(HALF), **dict.fromkeys(REST, 0.5), gear_changes=1, ended="holding", axes=("a",)
)


def test_the_catalogue_names_what_the_studies_have() -> None:
    axes = {name: study.axes for name, study in STUDIES.items()}
    assert set(axes["scales"]["robots"].values) == set(robot_drives.ROBOTS)
    assert set(axes["parking"]["scenes"].values) == {*KINDS, *KINDS_OF_CARS}
    assert set(axes["hard"]["rows"].values) == set(HARD)
    assert set(axes["limits"]["robots"].values) == set(LIMITS)
    assert set(axes["maps"]["families"].values) == set(FAMILIES)
    assert set(axes["maps"]["conditions"].values) == set(CONDITIONS)
    assert set(axes["maps"]["controllers"].values) == {spec.label for spec in STUDY_CONTENDERS}
    assert set(axes["real"]["models"].values) == {recipe.name for recipe in RECIPES}


def test_values_are_asked_for_by_parts_of_their_names_and_by_numbers() -> None:
    robots, reach = STUDIES["limits"].axes["robots"], STUDIES["sight"].axes["reach"]
    assert robots.choose("--robots", ["3 m/s"]) == ("3 m/s, 1 m/s^2, 3 rad/s^2",)
    assert len(robots.choose("--robots", None)) == 8
    assert reach.choose("--reach", ["4", "3.5"]) == (4.0, 3.5)
    assert STUDIES["clutter"].axes["worlds"].choose("--worlds", ["barn:x"]) == ("barn:x",)
    for axis, word in ((robots, "7 m/s"), (reach, "far"), (reach, "-1"), (reach, "nan")):
        with pytest.raises(ScenarioError, match="expected a part of one of"):
            axis.choose("--some", [word])


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


def test_rows_are_kept_and_only_what_is_missing_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, told, driven = tmp_path / "drives.jsonl", list[tuple[int, int]](), list[int]()

    def drive(name: str, seed: int) -> DriveResult:
        driven.append(seed)
        if seed > 5:
            raise RuntimeError("worker died")
        return replace(ROW, seconds=float(seed), clearance=math.inf)

    def drives(*seeds: int) -> list[DriveResult]:
        work = Work(starmap, lambda *progress: told.append(progress), file)
        return work.rows(SCALES, SCALES.asked([["x1"]], seeds))

    monkeypatch.setattr(robot_drives, "drive_named", drive)
    first = drives(1, 2)
    assert [row.seconds for row in first] == [1.0, 2.0] and first[0].axes == ("x1",)
    assert told[-1] == (2, 2)
    with pytest.raises(RuntimeError, match="worker died"):
        drives(3, 9)
    # the process was killed while it wrote
    file.write_text(file.read_text() + '{"study": "sca')
    told.clear()
    assert [row.seconds for row in drives(3, 2, 4)] == [3.0, 2.0, 4.0]
    assert told == [(2, 3), (3, 3)] and len(file.read_text().splitlines()) == 4
    assert driven == [1, 2, 3, 9, 4]
    for line in ('{"study": "jumps", "asked": [1], "row": {}}', '{"study": "scales"}', "[]"):
        file.write_text(line + "\n")
        with pytest.raises(DataError, match="line 1: expected a drive of kmpc study scales, got"):
            drives(1)


def test_a_table_counts_compares_and_names_what_went_wrong() -> None:
    rows = [
        replace(ROW, axes=("ours", "x"), seed=1, seconds=8.0),
        replace(ROW, axes=("ours", "x"), seed=2, arrived=False, ended="waiting: for a path"),
        replace(ROW, axes=("theirs", "x"), seed=1, peer=True),
        replace(ROW, axes=("theirs", "x"), seed=2, peer=True, arrived=False, collided=True),
    ]
    text = table(rows, (*DRIVES, TIME, AT_LEAST, beside(rows, 0, "theirs")), "map").splitlines()
    assert text[1].split() == ["ours", "x", "2", "1", "0", "1.00", "9.5%", "0.80"]
    assert text[2].split() == ["theirs", "x", "2", "1", "1", "1.25", "9.5%", "1.00"]
    assert text[3].split()[0] == "all" and text[4:] == ["ours, x, map 2: waiting: for a path"]
