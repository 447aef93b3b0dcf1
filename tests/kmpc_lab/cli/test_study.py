"""`kmpc study`: its tables and records, and what it needs."""

from __future__ import annotations

import argparse
import json
import re
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_folder import NEEDS_PICTURES, files
from emulated_robots import start_command
from waiting import until

from kmpc_lab.cli import bench
from kmpc_lab.cli.bench import COMPARISON, JOBS, LOOP, Job
from kmpc_lite.cli import main as cli


@pytest.mark.parametrize(
    "study", ["anyrobot --drives 1 --wheels car", "scales --drives 1 --robots x1 one-minute"]
)
def test_what_was_driven_is_not_driven_again(
    study: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["study", *study.split(), "--workers", "1", "--records", "drives.jsonl"]
    assert cli.main(arguments) == 0
    table, err = capsys.readouterr()
    assert err == ""  # no progress bar if there is no terminal
    monkeypatch.setattr("kmpc_lab.studies.study.drive_one", lambda *asked: pytest.fail())
    assert cli.main([*arguments, "--resume"]) == 0
    assert capsys.readouterr().out == table
    assert cli.main([*arguments, "--resume", "--json", "--picture", "worst.png"]) == 0
    assert (here / "worst.png").read_bytes().startswith(b"\x89PNG")
    rows = json.loads(capsys.readouterr().out)
    assert all(row["arrived"] and not row["collided"] for row in rows)
    assert len((here / "drives.jsonl").read_text().splitlines()) == len(rows)


def test_study_reports_at_once_that_peers_are_missing(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    monkeypatch.setattr("kmpc_lab.studies.study.drive_one", lambda *_: pytest.fail("it drove"))
    assert cli.main(["study", "table1", "--workers", "1"]) == 2
    assert "pip install 'kmpc-lab[peers]'" in capsys.readouterr().err


def test_a_word_that_stands_for_nothing_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["study", "parking", "--scenes", "garage"]) == 2
    assert "--scenes: expected a part of one of open; bay;" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("--families open walls", "K-NMPC, IPOPT: expected maps of circles, got walls"),
        ("--conditions lag", "K-NMPC, IPOPT: expected the condition plain"),
    ],
)
def test_what_a_peer_cannot_drive_is_refused_before_it_is_learned(
    asked: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["study", "maps", *asked.split(), "--drives", "1"]) == 2
    assert told in capsys.readouterr().err


LINES = {
    "--drives": "--drives 3",
    "--tuning": "--tuning",
    "--only": "--only ours",
    "--seconds": "--seconds 5",
    "--no-load": "--no-load",
    "--budget": "--budget 0.01",
}
CASES = [("", COMPARISON), ("--loop 100", LOOP), *JOBS.items()]


def measured(options: argparse.Namespace) -> tuple[Any, str]:
    return {}, "measured"


@pytest.mark.parametrize(("line", "job"), CASES, ids=[line or "none" for line, _ in CASES])
def test_a_job_refuses_the_options_that_it_does_not_read(
    line: str, job: Job, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = replace(job, measure=measured)
    monkeypatch.setattr(bench, "COMPARISON", quick)
    monkeypatch.setattr(bench, "LOOP", quick)
    monkeypatch.setattr(bench, "JOBS", {option: quick for option in JOBS})
    assert set(LINES) == set(bench.SHARED) >= set(job.reads)
    for option, words in LINES.items():
        status = cli.main(["bench", *line.split(), *words.split()])
        out, err = capsys.readouterr()
        if option in job.reads:
            assert (status, out, err) == (0, "measured\n", "")
        else:
            name = " ".join(["kmpc bench", *line.split()[:1]])
            assert status == 2 and not out
            assert err.startswith(f"kmpc bench: {option}: {name} does not read it")
            assert len(err.splitlines()) == 1


def test_emulate_serves_until_it_is_ended_and_reports_where_the_robot_is(desk):
    child = start_command(
        "emulate", "mavlink", "--link", "pty:rover", "--start", "0.5", "0.25", "0.1", "--json"
    )
    assert until(lambda: Path("rover").is_symlink())
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=20.0)
    assert (child.returncode, err) == (0, "") and json.loads(out)["pose"] == [0.5, 0.25, 0.1]
    assert not Path("rover").is_symlink()


def test_report_of_a_run_and_of_its_model(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(f"report {made}/run -o run.html --model {made}/robot.npz --json".split()) == 0
    assert json.loads(capsys.readouterr().out) == {"written": ["run.html"]}
    page = (here / "run.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html>")
    # self-contained: nothing is fetched
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)


@NEEDS_PICTURES
def test_report_as_a_picture(made: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(made / "run"), "--picture", "run.png"]) == 0
    assert capsys.readouterr().out.split() == ["wrote", "run.png"] and files(here) == ["run.png"]
    assert Path("run.png").read_bytes().startswith(b"\x89PNG")


@NEEDS_PICTURES
@pytest.mark.parametrize(
    "line",
    ["report {made}/run -o no/folder/run.html", "report {made}/run --picture no/folder/run.png"],
)
def test_a_report_that_cannot_be_written_is_reported_in_one_line(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str], blank: None
) -> None:
    assert cli.main([word.format(made=made) for word in line.split()]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(here) == []
