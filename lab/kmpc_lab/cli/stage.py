"""What the phases of a demo share: its robot file, the emulated rover, and how that sees."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from firmware_bridge.drivers.boards import BOARDS
from firmware_bridge.messages import LinkError

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario

SCENARIO = "four_circles_1"
START_TIME = 20.0
"""How long an emulator may take to start [s]."""


@dataclass(frozen=True)
class Stage:
    """What the recording and the drive share."""

    file: Path
    """Robot file."""
    rover: Callable[..., AbstractContextManager[None]]
    """Starts the emulated rover with options, and ends it with the block."""
    scenario: Scenario
    folder: Path
    say: Callable[[str], None]
    quiet: bool
    lidar: str | None
    """Of the drive: then the only source of obstacles."""

    @property
    def eyes(self) -> dict[str, str | None]:
        """``[lidar]`` section of the drive."""
        link = f"pty:{self.file.parent}/lidar"
        # the map has no walls around it: beams that end nowhere have nothing before them
        return {"driver": self.lidar, "no_return": "free", "link": link} if self.lidar else {}

    @property
    def seeing(self) -> list[str]:
        """Options of `kmpc emulate` that let the rover see."""
        named = {"--lidar": self.lidar, "--lidar-link": self.eyes.get("link")}
        return [word for name, value in named.items() if value for word in (name, value)]


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
                assert child.stderr is not None
                raise LinkError(f"the emulator did not start: {child.stderr.read().strip()}")
            time.sleep(0.02)
        yield
    finally:
        child.terminate()
        child.wait()
