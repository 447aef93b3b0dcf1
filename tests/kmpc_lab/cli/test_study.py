"""`kmpc study`: its tables and records, and what it needs."""

import json
import sys
from pathlib import Path

import pytest

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
