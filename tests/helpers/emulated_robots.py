"""Emulated robots at the end of a pseudo-terminal, for commands of the bridge to drive."""

import contextlib
import subprocess
import sys
import threading
from pathlib import Path

from courses import PATIENT

from firmware_bridge.robot_file import load_robot
from kmpc_lab.emulator.build import build_emulator

ROBOTS = Path(__file__).parents[2] / "docs" / "robots"
FAST = ["--v-max", "0.5", "--omega-max", "1.5", "--settle", "0.3", "--seconds", "60"]
"""Options of a run that a test waits for."""


@contextlib.contextmanager
def emulated(name: str, url: str = "pty:link", start=(0.0, 0.0, 0.0), arm_after: float = 0.1):
    robot = load_robot(ROBOTS / f"{name}.toml", {"link": {"url": url}})
    emulator = build_emulator(robot, start, 0.0, 1.0, 0, arm_after)
    emulator.start(url)
    try:
        yield emulator
    finally:
        emulator.close()


def robot_options(name: str) -> list[str]:
    quick = ["--set", "safety.hold=1", "--set", "safety.settle=0.2"]
    return [
        str(ROBOTS / f"{name}.toml"),
        "--link",
        "pty:link",
        *quick,
        *PATIENT,
        *(["--arm"] if name == "rover" else []),
    ]


@contextlib.contextmanager
def meanwhile(action):
    """Run `action` in another thread, since commands want the main one."""
    problems = []

    def guarded():
        try:
            action()
        except BaseException as error:
            problems.append(error)

    thread = threading.Thread(target=guarded)
    thread.start()
    yield
    thread.join(30.0)
    assert not thread.is_alive() and not problems, problems


def start_command(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "kmpc_lite.cli.main", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
