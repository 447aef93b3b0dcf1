"""`kmpc run` on emulated robots over real links: past an obstacle to the goal, and recorded."""

from __future__ import annotations

import json
import math
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from courses import FAR, PATIENT
from emulated_robots import FAST, emulated, meanwhile, robot_options, start_command
from waiting import until

import kmpc_lab
import kmpc_lite as kl
from firmware_bridge.integration.course import misplaced
from firmware_bridge.robot_file import load_robot
from firmware_bridge.safety.estop_client import ask
from firmware_bridge.safety.places import latch_file
from kmpc_lab.emulator.build import build_emulator
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lite.cli.main import main
from kmpc_lite.scenario.files import Scenario


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
        steps = [np.diff(e.states[:, :2], axis=0) for e in kl.Dataset.load(log).episodes]
        assert 0.5 < np.hypot(*np.concatenate(steps).T).sum() < 1.5


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


LINK = "pty:link"
LONG = "Battery 1 below minimum arming voltage and the compass is not calibrated, calibrate it"


@pytest.fixture
def rover(desk):
    robot = load_robot(None, {"link": {"url": LINK, "driver": "mavlink"}})
    # it may be armed at once: on a busy machine a check is over before it has begun to run
    rover = build_emulator(robot, (-2.0, 0.0, 0.0), 0.0, 1.0, 0, arm_after=0.0)
    rover.start(LINK)
    yield rover
    rover.close()


def test_a_vehicle_that_does_not_arm_ends_the_run_with_its_own_words(rover, capsys):
    rover.autopilot.arming_failure = LONG
    command = [
        *f"run --driver mavlink --link {LINK}".split(),
        *PATIENT,
        *"--scenario four_circles_1".split(),
    ]
    assert main([*command, "--arm", "--wait", "2", "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "never drove"
    assert sum(LONG in why for why in report["why"]) == 1, "once, and not again in its own words"
    assert main([*command, "--arm", "--seconds", "2"]) == 1
    told = capsys.readouterr().out
    assert "never drove" in told
    assert f"Arm: {LONG}" in told, "whole, on the terminal too"


def test_check_reports_what_the_autopilot_says_and_nothing_else_is_missing(rover, capsys):
    rover.autopilot.arming_failure = LONG
    command = ["check", "--driver", "mavlink", "--link", LINK, *PATIENT, "--seconds", "0.5"]
    assert main(command) == 1
    missing = [line for line in capsys.readouterr().out.splitlines() if line.startswith("MISSING")]
    assert missing == [f"MISSING  the autopilot would not arm: PreArm: {LONG}"]
    rover.autopilot.arming_failure = ""
    rover.parameters.set("ARMING_CHECK", 0)
    assert main(command) == 0


def test_a_drive_that_does_not_arrive_is_exit_status_1_and_prints_what_was_measured(desk, capsys):
    with emulated("roboclaw"):
        Path("far.toml").write_text(FAR)
        assert (
            main(["run", *robot_options("roboclaw"), "--scenario", "far.toml", "--seconds", "1"])
            == 1
        )
    out = capsys.readouterr().out
    for words in (
        "IDLE -> WAITING",
        "ACTIVE -> STOPPING",
        "time is up: after ",
        "pose to command on the wire",
        "p99.9",
        "command spacing, off by",
    ):
        assert words in out
    assert "board not ready" not in out.partition("WAITING -> ACTIVE")[2], "it was given back by us"
    assert "\x1b" not in out  # no terminal, no picture


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGQUIT, marks=pytest.mark.long)]
)
def test_ctrl_c_brakes_holds_and_releases(desk, number):
    with emulated("rover") as rover:
        Path("far.toml").write_text(FAR)
        child = start_command("run", *robot_options("rover"), "--scenario", "far.toml", "--json")
        assert until(lambda: not rover.stopped and rover.pose[0] > 0.1)
        child.send_signal(number)
        out, err = child.communicate(timeout=20.0)
        assert (
            child.returncode == 130
            and err.startswith("kmpc: control.latency: not given")
            and err.count("\n") == 1
        )
        assert until(lambda: rover.stopped) and rover.mode == "HOLD"
    report = json.loads(out)
    assert (
        report["outcome"] == f"stopped by {number.name}"
        and report["loop"]["changes"][-1]["to"] == "RELEASED"
    )


def test_kill_9_leaves_the_robot_to_the_boards_own_watchdog(desk):
    with emulated("roboclaw") as board:
        Path("far.toml").write_text(FAR)
        child = start_command("run", *robot_options("roboclaw"), "--scenario", "far.toml")
        assert until(lambda: not board.stopped and board.pose[0] > 0.1)
        child.kill()
        child.communicate()
        assert until(lambda: board.stopped)  # no other process is there to do it


WORDS = "m from the scenario's start: is frame.origin right?"


@pytest.mark.parametrize(("depth", "refused"), [(-0.1, False), (0.07, False), (0.08, True)])
def test_half_its_radius_inside_cannot_be_true(depth, refused, desk):
    scenario = Scenario.load("course.toml")
    x, y, radius = 0.4, 0.45, 0.1 + scenario.radius
    told = misplaced(scenario, (x - radius + depth, y, 0.0))
    assert bool(told) == refused
    assert misplaced(scenario, (math.nan, 0.0, 0.0)) == ""
    if refused:
        assert told.startswith("stands inside an obstacle by 0.08 m") and told.endswith(WORDS)


def test_run_and_check_refuse_a_robot_in_a_wall(desk, capsys):
    with emulated("rover") as rover:
        command = [*robot_options("rover"), "--scenario", "walls_door", "--json"]
        assert main(["run", *command, "--seconds", "20"]) == 1
        report = json.loads(capsys.readouterr().out)
        assert report["outcome"].startswith("not driven: stands inside an obstacle by 0.1")
        assert report["outcome"].endswith(f"1.80 {WORDS}")
        assert report["arrived_after_s"] is None and rover.pose == (0.0, 0.0, 0.0)
        options = [*command[:3], *PATIENT, *command[-3:]]

        def refused():
            assert main(["check", *options, "--seconds", "2"]) == 1
            found = json.loads(capsys.readouterr().out)["findings"]
            return [f for f in found if f["text"].endswith(f"1.80 {WORDS}") and not f["ok"]]

        assert until(refused)
        options += ["--set", "frame.origin=[-1.5, -1.0, 0.0]"]
        main(["check", *options, "--seconds", "2"])
        assert WORDS not in capsys.readouterr().out


def test_the_emergency_stop_stops_a_running_robot_and_outlives_the_run(desk, capsys):
    Path("far.toml").write_text(FAR)
    with emulated("roboclaw") as board:
        child = start_command("run", *robot_options("roboclaw"), "--scenario", "far.toml", "--json")
        assert until(lambda: not board.stopped and board.pose[0] > 0.1)
        assert main(["estop", "--json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert {
            "ok": True,
            "latched": True,
            "gate": "ESTOP",
            "confirmed": True,
        }.items() <= answer.items()
        assert until(lambda: board.stopped)
        assert main(["estop", "--enable"]) == 1
        time.sleep(0.6)  # longer than it brakes before it releases
        assert board.stopped and "pressed, gate ESTOP" in capsys.readouterr().out
        assert main(["estop", "--reset"]) == 0 and main(["estop", "--enable"]) == 0
        assert until(lambda: not board.stopped)
        child.send_signal(signal.SIGUSR1)
        assert until(lambda: ask(Path("run/kmpc-bridge.sock"), "status")["gate"] == "ESTOP")
        child.send_signal(signal.SIGTERM)
        report = json.loads(child.communicate(timeout=20.0)[0])
        assert child.returncode == 130 and report["outcome"] == "stopped by SIGTERM"
        # the next run refuses, until it is reset
        capsys.readouterr()
        command = ["run", *robot_options("roboclaw"), "--scenario", "course.toml", *FAST]
        assert main(command) == 2
        assert "the emergency stop is pressed" in capsys.readouterr().err
        assert (
            main(["estop", "--reset"]) == 0
            and not latch_file(Path("run/kmpc-bridge.sock")).exists()
        )


def test_the_emergency_stop_without_a_bridge_keeps_the_next_one_still(desk, capsys):
    assert main(["estop", "--status"]) == 1
    assert main(["estop"]) == 1
    assert (
        "no bridge is running" in capsys.readouterr().out
        and latch_file(Path("run/kmpc-bridge.sock")).exists()
    )
    assert main(["estop", "--enable"]) == 1
    assert main("check --driver mavlink --link tcp:127.0.0.1:9 --timeout 0.2 --json".split()) == 1
    texts = [f["text"] for f in json.loads(capsys.readouterr().out.splitlines()[-1])["findings"]]
    assert any("the emergency stop is pressed" in t for t in texts)
    assert main(["estop", "--reset", "--socket", "run/kmpc-bridge.sock"]) == 0
    assert not latch_file(Path("run/kmpc-bridge.sock")).exists()
