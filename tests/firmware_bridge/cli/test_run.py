"""`kmpc run` on emulated robots over real links: past an obstacle to the goal, and recorded."""

import json
import math
import time
from pathlib import Path

import numpy as np
import pytest
from emulated_robots import FAST, emulated, meanwhile, robot_options
from waiting import until

import kmpc_lab
import kmpc_lite as kl
from firmware_bridge.safety.estop_client import ask
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lite.cli.main import main


def look_at_the_states(states):
    """It drove and held its goal; where the machine is busy it may have braked and gone on."""
    assert states[:2] == ["WAITING", "ACTIVE"] and states[-1] in ("RELEASED", "STOPPING")
    assert set(states[2:-1]) <= {"WAITING", "ACTIVE", "HOLDING", "STOPPING"}


def look_at_the_recording(run, report):
    """What a drive recorded of itself is what was driven."""
    details, outcome = run.details, report["arrived_after_s"]
    assert run.outcome.value == "reached" and run.duration == outcome == report["duration_s"]
    assert run.position_error == report["position_error_m"]
    assert run.heading_error == report["heading_error_rad"]
    assert run.info["kind"] == "driven" and "ended" not in run.info
    states = [state for _, state, _ in details.gates if state != "IDLE"]
    changes = [b for a, b in zip(["", *states], states, strict=False) if a != b]
    look_at_the_states(changes)
    assert abs(next(t for t, state, _ in details.gates if state == "ACTIVE")) < 1e-9
    assert details.times[-1] > outcome and (np.diff(details.times) > 0.0).all()
    assert np.nanmax(details.pose_ages) < 5.0 and (details.step_times > 0.0).all()
    assert len(details.sent) == report["loop"]["commands_sent"]
    assert len(details.measured) > 20 and details.health[-1][1]["connected"]
    began = next(c["time"] for c in report["loop"]["changes"] if c["to"] == "ACTIVE")
    assert began == 0.0, "the gate's changes are told by the drive's time"
    assert np.hypot(*(run.states[-1, :2] - (0.7, 0.15))) < 0.08
    assert details.margins.min() >= 0.05, "the scenario asks for so much"


SLOW = [
    pytest.param(name, marks=pytest.mark.long) for name in ("odrive", "vesc", "roboteq", "arduino")
]


@pytest.mark.parametrize("name", ["rover", "roboclaw", *SLOW])
def test_run_drives_past_the_obstacle_to_the_goal_and_records_it(desk, capsys, name):
    options = [*robot_options(name), *"--scenario course.toml --record drive --json".split(), *FAST]
    # where the machine is busy for a moment, the robot brakes and goes on: it is not given up
    options += ["--set", "safety.hold=3"]
    if name == "roboclaw":  # with a learned model, twenty times a second
        kl.fit(
            kmpc_lab.generate_dataset(
                kmpc_lab.DifferentialDrive(), episodes=10, steps=60, dt=0.1, seed=0
            )
        ).save("robot.npz")
        options += ["--model", "robot.npz", "--period", "0.05", "--trust-model"]
        options += ["--command-period", "0.1"]
    with emulated(name) as robot:
        assert main(["run", *options]) == 0
        assert until(lambda: robot.stopped)
        x, y, theta = robot.pose
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "arrived" and report["arrived"] and report["scenario"] == "course"
    assert math.hypot(x - 0.7, y - 0.15) < 0.08 and abs(math.remainder(theta, math.tau)) < 0.3
    # the goal was held within 5 cm; the last pose may be one of parking, or of a braking rover
    assert report["clearance_m"] > 0.0 and report["position_error_m"] <= 0.08
    look_at_the_states([c["to"] for c in report["loop"]["changes"]])
    assert report["loop"]["times_ms"]["controller"]["p99.9"] > 0.0
    data = kl.Dataset.load("drive/drive.csv")
    assert data.dt == pytest.approx(0.05 if name == "roboclaw" else 0.1) and data.steps > 10
    logs = ["drive/drive.tlog"] if name == "rover" else []
    assert report["files"] == ["drive/drive.csv", *logs, "drive/drive.mcap"]
    look_at_the_recording(load_drive(Path("drive")), report)
    assert kl.Dataset.load("drive", dt=0.1).steps > 10
    for log in logs:
        assert main(["replay", log, "--json"]) == 0
        replayed = json.loads(capsys.readouterr().out)
        assert replayed["seconds"] > 2.0 and replayed["poses"] > 100
        assert replayed["messages"]["SET_POSITION_TARGET_LOCAL_NED"] > 50
        assert 0.7 < replayed["distance"] < 1.5


def test_a_pilot_that_takes_over_keeps_the_rover_until_it_is_enabled_again(desk, capsys):
    seen = {}
    with emulated("rover") as rover:

        def pilot():
            assert until(lambda: rover.pose[0] > 0.1)
            rover.pilot_mode(0)  # MANUAL
            assert until(lambda: ask(Path("run/kmpc-bridge.sock"), "status")["gate"] == "YIELDED")
            time.sleep(0.5)
            seen["mode"] = rover.mode
            ask(Path("run/kmpc-bridge.sock"), "enable")

        with meanwhile(pilot):
            options = [*robot_options("rover"), *FAST, "--set", "safety.hold=3"]
            assert main(["run", *options, "--scenario", "course.toml", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert seen["mode"] == "MANUAL"
    changes = " ".join(c["to"] for c in report["loop"]["changes"])
    assert "YIELDED WAITING ACTIVE" in changes


def test_run_drives_a_route_without_a_scenario_and_reports_each_goal(desk, capsys):
    options = [*robot_options("roboclaw"), "--v-max", "0.5", "--omega-max", "1.5"]
    options += ["--settle", "0.3", "--goal", "0.4", "0", "0", "--goal", "0.4", "0.2", "90deg"]
    with emulated("roboclaw") as robot:
        assert main(["run", *options]) == 0
        assert until(lambda: robot.stopped)
        x, y, _ = robot.pose
    out = capsys.readouterr().out
    assert "goal 1 of 2 held after" in out and "arrived, 2 of 2 goals" in out
    assert math.hypot(x - 0.4, y - 0.2) < 0.08
