"""kmpc demo, shortened.

The phases follow each other through files, and a signal ends them.
"""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import kmpc_lab.cli.demo as demo
from kmpc_lab import Run
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lite.cli.main import main


@pytest.mark.long
def test_it_records_learns_drives_and_says_where_the_goal_was_not_reached(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(demo, "PATIENCE", 1.5)
    assert main(["demo", "--seconds", "11", "--output", str(tmp_path / "out"), "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "timeout" and report["rows"] > 80
    out = tmp_path / "out"
    files = [path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()]
    assert sorted(files) == sorted(demo.OWN_FILES)
    recorded = load_drive(out / "run")
    assert recorded.details is not None and len(recorded.details.times) >= 10
    assert "time is up" in recorded.info["ended"]
    assert recorded.details.paths, "the page shows what guidance followed"
    run = Run.load(tmp_path / "out" / "run.npz")
    assert len(run.inputs) >= 10 and np.abs(run.inputs).max() > 0.0


@pytest.mark.long
def test_ctrl_c_while_recording_ends_with_130_and_no_model(tmp_path):
    command = [sys.executable, *f"-m kmpc_lite.cli.main demo --output {tmp_path} --json".split()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        log, until = tmp_path / "drive.csv", time.monotonic() + 30.0
        while not (log.exists() and log.read_text().count("\n") > 3) and time.monotonic() < until:
            time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        report = json.loads(child.communicate(timeout=20)[0])
    # the emulator outlived the signal, so the gate could brake, hold and release
    assert child.returncode == 130 and report["loop"]["stop_reason"] == "SIGINT"
    assert "RELEASED" in [change["to"] for change in report["loop"]["changes"]]
    assert not (tmp_path / "robot.npz").exists()


@pytest.mark.long
def test_the_whole_demo_reaches_its_goal(tmp_path, capsys):
    assert main(["demo", "--output", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (
        report["outcome"] == "reached" and Run.load(tmp_path / "out" / "run.npz").clearance > 0.03
    )


@pytest.mark.long
@pytest.mark.parametrize("lidar", ["ld06", "rplidar", "mavlink"])
def test_the_demo_by_sight_alone_reaches_its_goal(tmp_path, capsys, lidar):
    folder = str(tmp_path / "out")
    words = ["demo", "--lidar", lidar, "--seconds", "20", "--output", folder, "--json"]
    assert main(words) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "reached" and report["clearance_m"] > 0.0
    assert report["link"]["reasons"].get("no scan of the lidar, or too old", 0) < 50


def test_a_busy_computer_is_told():
    from firmware_bridge.safety.gate_table import Reason
    from kmpc_lab.cli.demo import _busy

    assert _busy({"ticks": 1000, "reasons": {Reason.COMMAND.value: 10}}) == ""
    assert "for 30 % of the time" in _busy({"ticks": 1000, "reasons": {Reason.COMMAND.value: 300}})
    assert _busy({"ticks": 0, "reasons": {}}) == ""
