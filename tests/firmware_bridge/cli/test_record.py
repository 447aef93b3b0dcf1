"""`kmpc record`, at random and by hand: what it writes can be learned from."""

import json
import os
import signal
from pathlib import Path

import pytest
from emulated_robots import ROBOTS, emulated, meanwhile, robot_options
from waiting import until

import kmpc_lite as kl
from kmpc_lite.cli.main import main


def test_record_by_hand_sends_nothing_and_its_tlog_gives_the_same_csv(desk, capsys):
    with emulated("rover") as rover:
        rover.pilot_mode(0)

        def pilot():
            assert until(
                lambda: Path("hand.csv").exists() and Path("hand.csv").stat().st_size > 500
            )
            os.kill(os.getpid(), signal.SIGINT)

        with meanwhile(pilot):
            command = (
                f"record {ROBOTS}/rover.toml --link pty:link --by-hand --output hand --json".split()
            )
            assert main(command) == 0
        assert rover.mode == "MANUAL"
    report = json.loads(capsys.readouterr().out)
    assert report["rows"] > 5 and report["loop"]["commands_sent"] == 0
    assert {c["to"] for c in report["loop"]["changes"]} <= {"IDLE"}
    assert main(["replay", "hand.tlog", "--csv", "again.csv", "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert replayed["rows"] > 5 and "SET_POSITION_TARGET_LOCAL_NED" not in replayed["messages"]
    # a period is the median of stamps that are written with six digits; the pilot moved nothing
    again, hand = (kl.Dataset.load(f"{log}.csv", force=True).dt for log in ("again", "hand"))
    assert again == pytest.approx(hand, rel=1e-3)
    assert main(["replay", "hand.tlog", "--csv", "again.csv"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_vehicle_that_does_not_arm_ends_the_recording_with_its_own_words(desk, capsys):
    with emulated("rover", arm_after=0.0) as rover:
        rover.autopilot.arming_failure = "Compass not calibrated"
        command = ["record", *robot_options("rover"), "--output", "never", "--json"]
        fence = ["--geofence", "-2", "-2", "2", "2"]
        assert main([*command, "--excite", *fence, "--wait", "1.5"]) == 1
        report = json.loads(capsys.readouterr().out)
        assert "never drove within 1.5 s" in report["outcome"]
        assert "Arm: Compass not calibrated" in report["outcome"]
        assert main([*command, "--by-hand", "--wait", "2"]) == 2
        assert "--wait: goes with --excite" in capsys.readouterr().out
