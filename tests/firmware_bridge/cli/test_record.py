"""`kmpc record`, at random and by hand: what it writes can be learned from."""

import json
import os
import signal
from pathlib import Path

from emulated_robots import ROBOTS, emulated, meanwhile, robot_options
from waiting import until

from kmpc_lite.cli.main import main
from kmpc_lite.learn.formats.ardupilot import frames


def test_record_by_hand_sends_nothing(desk, capsys):
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
    told = {data[7] for _, _, data in frames(Path("hand.tlog"))}  # last byte of the message's id
    assert 32 in told and 84 not in told  # LOCAL_POSITION_NED, SET_POSITION_TARGET_LOCAL_NED


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
