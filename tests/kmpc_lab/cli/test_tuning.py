"""Faster, closer, smoother: each option changes the drive as its name says, or is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from kmpc_lab import Run
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lite.cli.main import main

DRIVE = "simulate --goal 1.4 0 0 --obstacle 0.7 0 0.15 --json --record"
CLOSE = "--clearance 0 --set guidance.wide_clearance=0.05 --set guidance.narrow_clearance=0.05"


def driven(name: str, more: str = "") -> Run:
    assert main(f"{DRIVE} {name} {more}".split()) == 0
    return load_drive(name)


def test_each_option_changes_the_drive_as_its_name_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    usual, slow = driven("usual"), driven("slow", "--max-speed 0.2")
    assert abs(slow.inputs[:, 0]).max() <= 0.2 < abs(usual.inputs[:, 0]).max()
    assert slow.duration > usual.duration
    wide, close = driven("wide", "--clearance 0.2"), driven("close", CLOSE)
    assert wide.clearance >= 0.2 > usual.clearance > close.clearance > 0.0
    smooth = driven("smooth", "--max-acceleration 0.3")
    change = np.abs(np.diff(smooth.inputs, axis=0)).max(axis=0) / smooth.dt
    assert (change <= (0.3 + 1e-6, 1.2 + 1e-6)).all()
    capsys.readouterr()
    assert main("report usual --beside wide close --picture p.png".split()) == 0
    assert (tmp_path / "p.png").stat().st_size > 10_000


@pytest.mark.parametrize("command", ["simulate", "run --driver mavlink --link tcp:127.0.0.1:1"])
@pytest.mark.parametrize(
    ("item", "words"),
    [
        ("margins.headwya=0.1", "did you mean 'headway'"),
        ("margns.headway=0.1", "did you mean 'margins'"),
        ("margins.headway=-1", "headway"),
        ("margins.headway", "expected "),
    ],
)
def test_what_no_controller_has_is_refused_with_the_nearest_name(
    command: str, item: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command.split(), "--goal", "1", "0", "0", "--set", item]) == 2
    err = capsys.readouterr().err
    assert words in err and item in err and err.count("\n") == 1


def test_a_drive_that_does_not_arrive_says_why_everywhere_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    late = "simulate --goal 3 0 0 --timeout 1".split()
    assert main([*late, "--record", "drive", "--report", "drive.html"]) == 1
    (why,) = (ln for ln in capsys.readouterr().out.splitlines() if ln.startswith("why"))
    assert "time is up after 1.0 s" in why and "from the goal: the robot was still driving" in why
    assert main([*late, "--json"]) == 1
    ended = json.loads(capsys.readouterr().out)["ended"]
    assert why.endswith(ended)
    assert ended in (tmp_path / "drive.html").read_text(encoding="utf-8")
    assert load_drive(tmp_path / "drive").info["ended"] == ended
