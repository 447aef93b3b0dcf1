"""Emulated boards in processes of their own, for what is measured with them."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from firmware_bridge.drivers.boards import BOARDS
from firmware_bridge.messages import LinkError

SCENARIO = "four_circles_1"
START_TIME = 20.0
"""How long an emulator may take to start [s]."""


def robot_text(driver: str, folder: Path, period: float) -> str:
    """Robot file of a ROSbot-sized robot that plans and commands every `period` [s]."""
    board = BOARDS[driver]
    sections: dict[str, Mapping[str, Any]] = {
        "link": {"url": f"pty:{folder}/{driver}", "driver": driver},
        "board": board.options,
        "geometry": board.geometry,
        "safety": {"socket": f"{folder}/estop"},
        "control": {"period": period, "command_period": period},
    }
    lines: list[str] = []
    for section, keys in sections.items():
        lines += [
            f"[{section}]",
            *(
                f"{key} = {str(value).lower() if isinstance(value, bool) else repr(value)}"
                for key, value in keys.items()
            ),
        ]
    return "\n".join(lines)


@contextmanager
def emulator(file: Path, link: Path, *options: str) -> Iterator[None]:
    """Emulate the board of a robot file in another process, with more options of `kmpc emulate`."""
    command = [
        sys.executable,
        "-m",
        "kmpc_lite.cli.main",
        "emulate",
        str(file),
        "--json",
        "--scenario",
        SCENARIO,
        *options,
    ]
    # a session of its own: Ctrl-C must brake the robot, not take it away
    child = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        until = time.monotonic() + START_TIME
        while not link.is_symlink():
            if child.poll() is not None or time.monotonic() > until:
                child.kill()
                raise LinkError(f"the emulator did not start: {child.communicate()[1].strip()}")
            time.sleep(0.02)
        yield
    finally:
        child.terminate()
        child.communicate()
