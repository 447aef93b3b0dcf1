"""`kmpc estop` and the run that it stops: the stop outlives it, and keeps the next one still."""

import json
import signal
import time
from pathlib import Path

from courses import FAR
from emulated_robots import FAST, emulated, robot_options, start_command
from waiting import until

from firmware_bridge.safety.estop_client import ask
from firmware_bridge.safety.places import latch_file
from kmpc_lite.cli.main import main


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
