"""kmpc demo, shortened.

The phases follow each other through files, and a signal ends them.
"""

import json
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

import firmware_bridge.cli.demo as demo
from firmware_bridge.cli.main import main
from firmware_bridge.cli.steps import Steps
from firmware_bridge.messages import BridgeError
from kmpc_lite.sim import Outcome, Run, Scenario


def steps_of(count: int) -> Steps:
    steps = Steps(demo.PERIOD)
    steps.is_driving = lambda: True
    plan = SimpleNamespace(
        command=np.zeros(2),
        states=np.zeros((3, 3)),
        status=SimpleNamespace(name="SOLVED"),
        timing={"total": 0.001},
    )
    for i in range(count):
        steps((0.1 * i, 0.0, 0.0), plan)
    return steps


@pytest.mark.parametrize(
    ("arrived", "clearance", "outcome", "count"),
    [
        (1.0, 0.1, Outcome.REACHED, 10),
        (None, 0.1, Outcome.TIMEOUT, 20),
        (1.0, -0.01, Outcome.COLLISION, 10),
    ],
)
def test_a_run_ends_where_the_goal_was_reached(arrived, clearance, outcome, count):
    report = {"arrived_after_s": arrived, "clearance_m": clearance}
    run = steps_of(21).as_run(Scenario.load("four_circles_1"), report, {})
    assert run.outcome is outcome and len(run.inputs) == count and len(run.states) == count + 1


def test_a_rover_that_never_drove_is_told_in_one_line():
    with pytest.raises(BridgeError, match="did not drive"):
        Steps(demo.PERIOD).as_run(
            Scenario.load("four_circles_1"), {"arrived_after_s": None, "clearance_m": None}, {}
        )


@pytest.mark.long
def test_it_records_learns_drives_and_says_where_the_goal_was_not_reached(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(demo, "PATIENCE", 1.5)
    assert main(["demo", "--seconds", "11", "--output", str(tmp_path / "out"), "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "timeout" and report["rows"] > 80
    assert sorted(os.listdir(tmp_path / "out")) == sorted(demo.OWN_FILES)
    run = Run.load(tmp_path / "out" / "run.npz")
    assert len(run.inputs) >= 10 and np.abs(run.inputs).max() > 0.0


def test_ctrl_c_while_recording_ends_with_130_and_no_model(tmp_path):
    command = [
        sys.executable,
        "-m",
        "firmware_bridge.cli.main",
        "demo",
        "--output",
        str(tmp_path),
        "--json",
    ]
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
