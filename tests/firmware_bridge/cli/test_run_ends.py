"""A run ends in any case: it says why, an autopilot's own words included, and the robot stands."""

import json
import signal
from pathlib import Path

import pytest
from courses import FAR, PATIENT
from emulated_robots import emulated, robot_options, start_command
from waiting import until

from firmware_bridge.robot_file import load_robot
from kmpc_lab.emulator.build import build_emulator
from kmpc_lite.cli.main import main

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
