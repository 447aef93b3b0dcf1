"""`kmpc demo` on a simulated robot, and through a link."""

import json
from pathlib import Path

import pytest
from command_folder import NEEDS_PICTURES, files

import kmpc_lite as kl
from kmpc_lab import load_drive
from kmpc_lite.cli import main as cli


@NEEDS_PICTURES
def test_demo_does_the_main_job(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["demo", "--robot", "simulated", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "reached" and told["clearance_m"] > 0
    assert set(files(here)) == {
        "out",
        "out/drive.csv",
        "out/report.html",
        "out/robot.npz",
        "out/run",
        "out/run/drive.mcap",
    }
    assert told["held_out"]["multi_step"][0] < told["held_out"]["nominal_multi_step"][0]
    # what it wrote is what the other commands take
    assert len(kl.Dataset.load("out/drive.csv")) == 20
    assert load_drive("out/run").scenario.name == "four_circles_1"
    assert cli.main(["report", "out/run", "-o", "again.html"]) == 0
    assert 'id="drive"' in Path("again.html").read_text(), "it plays"
    assert kl.KoopmanModel.load("out/robot.npz").info["log"] == ["out/drive.csv"]
    # it learns as kmpc fit does
    assert cli.main(["fit", "out/drive.csv", "-o", "fitted.npz"]) == 0
    assert Path("out/robot.npz").read_bytes() == Path("fitted.npz").read_bytes()


@pytest.mark.long
def test_the_whole_demo_reaches_its_goal(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert cli.main(["demo", "--output", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "reached"
    assert load_drive(tmp_path / "out" / "run").clearance > 0.03
