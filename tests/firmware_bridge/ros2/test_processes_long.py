"""`kmpc ros2` and `kmpc emulate ros2` as processes: killed, started again, interrupted."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")

from free_port import free_port

from firmware_bridge.messages import LinkError
from firmware_bridge.safety.estop_client import ask

KMPC = (sys.executable, "-m", "kmpc_lite.cli.main")


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen([*KMPC, *words], stdout=subprocess.PIPE, text=True)


def wait_for_gate(node: subprocess.Popen[str], socket: Path, *states: str) -> bool:
    """Wait until the gate of a bridge is in one of some states; it may take long to start."""
    until = time.monotonic() + 120.0
    while time.monotonic() < until and node.poll() is None:
        with contextlib.suppress(LinkError):
            if ask(socket, "status")["gate"] in states:
                return True
        time.sleep(0.05)
    return False


@pytest.mark.long
@pytest.mark.parametrize("sees", ["map", "scan"])
def test_a_drive_whose_robot_is_killed_and_comes_back(sees: str, tmp_path: Path) -> None:
    """With the robot goes the router, and with it every link of the node."""
    port, other = free_port(), {"map": "scan", "scan": "map"}[sees]
    robot = ["emulate", "ros2", "--link", f"tcp:127.0.0.1:{port}", "--sees", sees, "--json"]
    drive = ["ros2", "--connect", f"tcp/127.0.0.1:{port}", "--topic", f"{other}=", "--json"]
    # it comes back where it is put down, not where it was
    drive += ["--set", "safety.resume_within=10.0", "--set", "safety.resume=60.0"]
    drive += ["--goal", "1.5", "1.5", "0", "--v-max", "0.3", "--seconds", "300", "--timeout", "60"]
    first, node = start(*robot), start(*drive, "--socket", str(tmp_path / "estop"))
    try:
        assert wait_for_gate(node, tmp_path / "estop", "ACTIVE")
        time.sleep(1.0)
        first.kill()
        first.wait()
        assert wait_for_gate(node, tmp_path / "estop", "HOLDING", "STOPPING", "RELEASED")
        second = start(*robot, "--start", "0.2", "0.0", "0.0")
        try:
            out, _ = node.communicate(timeout=330.0)
        finally:
            second.send_signal(signal.SIGINT)
            second.wait(20.0)
    finally:
        first.kill()
        node.kill()
    report = json.loads(out)
    assert report["outcome"] == "arrived", report["why"]
    assert node.returncode == 0
    states = [change["to"] for change in report["loop"]["changes"]]
    assert states.count("ACTIVE") >= 1 and report["loop"]["errors"] == 0


@pytest.mark.long
def test_ctrl_c_leaves_a_robot_that_stands(tmp_path: Path) -> None:
    port = free_port()
    robot = start("emulate", "ros2", "--link", f"tcp:127.0.0.1:{port}", "--sees", "map", "--json")
    where = ("--connect", f"tcp/127.0.0.1:{port}", "--socket", str(tmp_path / "estop"))
    goal = ("--goal", "1.5", "1.5", "0", "--topic", "scan=", "--json", "--timeout", "60")
    node = start("ros2", *where, *goal)
    try:
        assert wait_for_gate(node, tmp_path / "estop", "ACTIVE")
        os.kill(node.pid, signal.SIGINT)
        out, _ = node.communicate(timeout=20.0)
        robot.send_signal(signal.SIGINT)
        told, _ = robot.communicate(timeout=20.0)
    finally:
        robot.kill()
        node.kill()
    assert json.loads(out)["outcome"] in ("stopped by SIGINT", "arrived")
    assert json.loads(told)["stopped"]
