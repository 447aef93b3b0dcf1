"""`kmpc ros2` in a process of its own, and the emulated robot in this one, over DDS on loopback."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from waiting import until

import kmpc_lite as kl
from kmpc_lite.scenario.files import Scenario

NO_ROS = "no wheels of ROS 2 for this Python and machine: pip install 'kmpc-lite[ros2-test]'"
HERE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "77"}


def short_course(**changes: Any) -> Scenario:
    """Past a circle that stands in the way, within a metre."""
    circles = (kl.Circle(0.35, 0.03, 0.06),)
    course = {"circles": circles, "radius": 0.1, "start": (0.0, 0.0, 0.0), "goal": (0.7, 0.0, 0.0)}
    return replace(Scenario.load("four_circles_1"), **{**course, **changes})


class Drive:
    """A drive of `kmpc ros2`; both live in a namespace of their own.

    `arguments`: of the command, and of ROS behind ``--ros-args``. `course`: what is driven on.
    `robot`: fields of EmulatedRobot.
    """

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        arguments: str,
        course: Scenario | None = None,
        **robot: Any,
    ) -> None:
        pytest.importorskip("rclpy", reason=NO_ROS)
        from kmpc_lab.emulator.ros2 import EmulatedRobot, Ros2Emulator

        for name, value in HERE.items():
            monkeypatch.setenv(name, value)
        self.namespace = f"/t{uuid4().hex}"
        own = ("-r", f"__ns:={self.namespace}", "-r", f"/clock:={self.namespace}/clock")
        self.robot = Ros2Emulator(course or short_course(), EmulatedRobot(**robot), 0, own)
        words, _, ros = arguments.partition("--ros-args")
        usual = f"--v-max 0.6 --radius 0.1 --socket {folder}/estop --settle 0.3 --json"
        self._command = [
            *(sys.executable, "-m", "kmpc_lite", "ros2", *words.split(), *usual.split()),
            *("--ros-args", *ros.split(), *own),
        ]
        self.process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Drive:
        self.robot.start()
        pipe = subprocess.PIPE
        environment = {**os.environ, **HERE}
        self.process = subprocess.Popen(
            self._command, stdout=pipe, stderr=pipe, text=True, env=environment
        )
        return self

    def __exit__(self, *error: object) -> None:
        self.process.kill()
        self.process.communicate()
        self.robot.close()

    def report(self, seconds: float = 60.0) -> dict[str, Any]:
        """Wait until it ends; what it tells."""
        out, err = self.process.communicate(timeout=seconds)
        assert out, err
        return {**json.loads(out), "status": self.process.returncode, "stderr": err}

    def wait_for(self, condition: Any, what: str) -> None:
        """Wait, as long as it runs."""
        assert until(lambda: condition() or self.process.poll() is not None, 40.0), what
        assert condition(), self.process.communicate()

    def ended(self) -> bool:
        """Whether it has ended."""
        return self.process.poll() is not None

    def end(self, number: int = signal.SIGINT) -> None:
        self.process.send_signal(number)
