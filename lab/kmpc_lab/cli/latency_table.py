"""The table of `kmpc latency`: a row of times for each driver and rate, by emulated boards.

The boards run in processes of their own.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from firmware_bridge.drivers.boards import BOARDS
from firmware_bridge.messages import LinkError
from firmware_bridge.robot_file import Robot, load_robot

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


MEASURED = tuple(name for name, board in BOARDS.items() if board.encoders)
"""Drivers whose latency can be measured: a board without encoders says nothing."""
COLUMNS = (
    "pose age when planning",
    "controller",
    "pose to command on the wire",
    "command spacing, off by",
    "gate period, late by",
)
SHOWN = ("p50", "p99", "p99.9", "max")


def progress_line(stream: TextIO | None) -> Callable[[str], None]:
    """Shows what is under way in one line of a terminal, nothing elsewhere."""

    def say(text: str) -> None:
        if stream is not None and stream.isatty():
            stream.write(f"\r\x1b[2K{text}")
            stream.flush()

    return say


def measure(
    drivers: Sequence[str],
    rates: Sequence[float],
    drive: Callable[[Robot], dict[str, Any]],
    progress: TextIO | None,
) -> list[dict[str, Any]]:
    """Drive each board at each rate; gives a row of times [ms] each.

    Parameters
    ----------
    drivers : sequence of str
        Which boards.
    rates : sequence of float
        Of plans and commands [Hz].
    drive : callable
        Drives a robot and gives the report of the run.
    progress : text stream, optional
        Where to say what is under way.
    """
    rows, say = [], progress_line(progress)
    for driver in drivers:
        for rate in rates:
            with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
                folder = Path(name)
                file = folder / "robot.toml"
                file.write_text(robot_text(driver, folder, 1.0 / rate))
                say(f"{driver} at {rate:g} Hz ...")
                with emulator(file, folder / driver):
                    report = drive(load_robot(file))
            loop = report["loop"]
            rows.append(
                {
                    "driver": driver,
                    "rate_hz": rate,
                    "outcome": report["outcome"],
                    "commands": loop["commands_sent"],
                    "skipped": loop["ticks_skipped"],
                    "times_ms": {column: loop["times_ms"][column] for column in COLUMNS},
                }
            )
    say("")
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Render the rows for people."""
    width = 8 * len(SHOWN)
    head = f"{'[ms]':<10}{'Hz':>4}{'sent':>7}" + "".join(
        f"  {column:>{width}}" for column in COLUMNS
    )
    lines = [
        head,
        " " * 21 + "".join("  " + "".join(f"{name:>8}" for name in SHOWN) for _ in COLUMNS),
    ]
    for row in rows:
        line = f"{row['driver']:<10}{row['rate_hz']:>4g}{row['commands']:>7}"
        for column in COLUMNS:
            times = row["times_ms"][column]
            line += "  " + "".join(
                f"{'-' if times[name] is None else format(times[name], '.2f'):>8}" for name in SHOWN
            )
        lines.append(line)
    return "\n".join(lines)
