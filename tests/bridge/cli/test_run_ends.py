"""A run ends in any case, and says why in the autopilot's own words."""

import json

import pytest
from courses import PATIENT

from firmware_bridge.cli.emulate import build_emulator
from firmware_bridge.cli.main import main
from firmware_bridge.robot_file import load_robot

LINK = "pty:link"
LONG = "Battery 1 below minimum arming voltage and the compass is not calibrated, calibrate it"


@pytest.fixture
def rover(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    robot = load_robot(None, {"link": {"url": LINK, "driver": "mavlink"}})
    # it may be armed at once: on a busy machine a check is over before it has begun to run
    rover = build_emulator(robot, (-2.0, 0.0, 0.0), 0.0, 1.0, 0, arm_after=0.0)
    rover.start(LINK)
    yield rover
    rover.close()


def test_a_vehicle_that_does_not_arm_ends_the_run_with_its_own_words(rover, capsys):
    rover.autopilot.arming_failure = LONG
    command = [
        "run",
        "--driver",
        "mavlink",
        "--link",
        LINK,
        *PATIENT,
        "--scenario",
        "four_circles_1",
    ]
    assert main([*command, "--arm", "--wait", "2", "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "never drove"
    assert any(LONG in why for why in report["why"])
    assert main([*command, "--arm", "--seconds", "2"]) == 1
    told = capsys.readouterr().out
    assert "never drove" in told
    assert f"Arm: {LONG}" in told, "whole, on the terminal too"


def test_check_tells_what_the_autopilot_says_and_nothing_else_is_missing(rover, capsys):
    rover.autopilot.arming_failure = LONG
    command = ["check", "--driver", "mavlink", "--link", LINK, *PATIENT, "--seconds", "0.5"]
    assert main(command) == 1
    missing = [line for line in capsys.readouterr().out.splitlines() if line.startswith("MISSING")]
    assert missing == [f"MISSING  the autopilot would not arm: PreArm: {LONG}"]
    rover.autopilot.arming_failure = ""
    rover.parameters.set("ARMING_CHECK", 0)
    assert main(command) == 0
