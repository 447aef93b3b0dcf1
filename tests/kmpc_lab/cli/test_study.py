"""`kmpc study table1`: its table, and what it needs."""

import json
import sys
from functools import partial
from pathlib import Path

import pytest

from kmpc_lab.studies import contenders
from kmpc_lab.studies import table1 as study
from kmpc_lite.cli import main as cli


def small_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Table 1 with two controllers at one slip, little training and a short drive."""
    rows = (
        contenders.Contender("exact", fit=None),
        contenders.Contender("learned", "paper"),
    )
    table = partial(
        study.table1, controllers=rows, lambdas=(0.0,), training={"episodes": 6, "steps": 30}
    )
    monkeypatch.setattr(study, "table1", table)
    monkeypatch.setattr(contenders, "TABLE_1_CONTENDERS", rows)


def test_study_prints_the_table(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small_table(monkeypatch)
    words = f"--trials 1 --workers 1 --scenario {made}/short.toml --records table.jsonl"
    arguments = ["study", "table1", *words.split()]
    assert cli.main(arguments) == 0
    out, err = capsys.readouterr()
    assert "paper: K-NMPC" in out and "exact" in out and "learned, trained at 0.1" in out
    assert err == ""  # no progress bar if there is no terminal
    assert cli.main([*arguments, "--json", "--resume"]) == 0  # nothing is driven again
    cells = json.loads(capsys.readouterr().out)
    assert [(c["controller"], c["slip"], c["trials"]) for c in cells] == [
        ("exact", 0.0, 1),
        ("learned", 0.0, 1),
        ("learned", 0.15, 1),
        ("learned", 0.2, 1),
    ]


def test_study_reports_at_once_that_peers_are_missing(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    monkeypatch.setattr(study, "train", lambda *_: pytest.fail("trained before it looked"))
    assert cli.main(["study", "table1", "--workers", "1"]) == 2
    assert "pip install 'kmpc-lab[peers]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "study", ["anyrobot --drives 1 --wheels car", "scales --drives 1 --only one-minute"]
)
def test_robots_that_were_driven_are_not_driven_again(
    study: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["study", *study.split(), "--workers", "1", "--records", "drives.jsonl"]
    assert cli.main(arguments) == 0
    table, _ = capsys.readouterr()
    monkeypatch.setattr("kmpc_lab.studies.records._driven", lambda *asked: pytest.fail())
    assert cli.main([*arguments, "--resume"]) == 0
    assert capsys.readouterr().out == table
    assert len((here / "drives.jsonl").read_text().splitlines()) in (1, 2)
