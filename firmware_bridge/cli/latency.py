"""`kmpc latency`: latency and jitter of every driver.

Each drives an emulated board, in a process of its own, over a pseudo-terminal.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from firmware_bridge.cli.course import course
from firmware_bridge.messages import BridgeError, ConfigError, LinkError
from firmware_bridge.robot_file import DRIVERS, Robot, load_robot
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import count, positive

SCENARIO = "four_circles_1"
MEASURED = tuple(name for name in DRIVERS if name != "sabertooth")
"""Drivers whose latency can be measured: a Sabertooth says nothing."""
START_TIME = 20.0
"""How long an emulator may take to start [s]."""
GEOMETRY = {"wheel_radius": 0.0425, "track": 0.27, "max_wheel_speed": 0.9}
BOARDS: dict[str, dict[str, Any]] = {
    "mavlink": {"arm": True},
    "roboclaw": {"counts_per_turn": 1440.0},
    "odrive": {},
    "vesc": {"can_id": 1, "pole_pairs": 7},
    "roboteq": {"counts_per_turn": 1440.0},
    "arduino": {"counts_per_turn": 1440.0},
}
COLUMNS = (
    "pose age when planning",
    "controller",
    "pose to command on the wire",
    "command spacing, off by",
    "gate period, late by",
)
LONG = 3600.0
"""Nothing is to end a drive that is measured before it has been [s]."""
SHOWN = ("p50", "p99", "p99.9", "max")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add(
        "--seconds",
        type=positive,
        metavar="S",
        default=10.0,
        help="measuring time for each row of the table [s] (default: 10)",
    )
    add(
        "--drivers",
        nargs="+",
        choices=MEASURED,
        metavar="DRIVER",
        default=list(MEASURED),
        help=f"drivers to measure (default: all): {', '.join(MEASURED)}",
    )
    add(
        "--rates",
        nargs="+",
        type=positive,
        metavar="HZ",
        default=[10.0, 50.0],
        help="rates of plans and commands [Hz] (default: 10 50)",
    )

    add(
        "--flood",
        nargs="*",
        metavar="WORD",
        help="instead: flood each surface of a bridge that drives, and tell what that costs the\n"
        "gate, the standstill and the emergency stop; only floods whose name has a WORD",
    )
    add(
        "--live-clients",
        type=count,
        metavar="N",
        help="instead: drive with N browsers that watch a live page, one of which reads nothing,\n"
        "and without them, in turns of 2 s; tells the times of both and their ratio",
    )


def run(options: argparse.Namespace) -> int:
    """Measure and print the table."""
    if options.live_clients is not None:
        return _watched(options)
    if options.flood is not None:
        return _flood(options)
    if "mavlink" in options.drivers:
        need("the driver mavlink", "pymavlink")
    seconds: float = options.seconds

    def drive(robot: Robot) -> dict[str, Any]:
        from firmware_bridge.runtime.drive import run as drive_robot

        there = replace(robot, control=replace(robot.control, scenario=SCENARIO))
        job = course(there, seconds, seconds)
        return drive_robot(job.robot, job.navigator, job.period, job.origin, None, None)[0]

    rows = measure(options.drivers, options.rates, drive, None if options.json else sys.stderr)
    print(json.dumps(rows) if options.json else table(rows))
    return 0


def _flood(options: argparse.Namespace) -> int:
    """Measure and print the table of floods."""
    from firmware_bridge.attacks import floods as known
    from firmware_bridge.attacks import table as attacks

    need("--flood", "pymavlink")
    floods = attacks.chosen(options.flood)
    if not floods:
        names = "; ".join(f"{flood.surface.name}: {flood.name}" for flood in known.FLOODS)
        raise ConfigError(f"--flood {' '.join(options.flood)}: no flood has this in: {names}")
    rows = attacks.measure(floods, None if options.json else sys.stderr)
    print(json.dumps([r.as_dict() for r in rows]) if options.json else attacks.table(rows))
    return 0


def _watched(options: argparse.Namespace) -> int:
    """Measure and print what browsers cost."""
    from functools import partial

    from firmware_bridge.attacks.watching import Turns, told
    from firmware_bridge.cli.live import Showing
    from firmware_bridge.runtime.drive import run as drive_robot
    from kmpc_lite.cli.live_options import Views
    from kmpc_lite.live.address import LiveAddress

    with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
        folder = Path(name)
        file = folder / "robot.toml"
        file.write_text(robot_text("roboclaw", folder, 0.1))
        robot = load_robot(file)
        robot = replace(robot, control=replace(robot.control, scenario=SCENARIO))
        turns = Turns(options.live_clients, options.seconds, folder)
        showing = Showing(Views(LiveAddress(port=0), None), folder / "estop")
        job = course(robot, LONG, LONG, showing.saw)
        showing.job = job
        with emulator(file, folder / "roboclaw"), showing:
            watch = partial(turns.watch, job=job, showing=showing)
            where = (job.robot, job.navigator, job.period, job.origin)
            drive_robot(*where, None, None, watched=watch)
    rows = turns.table()
    if options.json:
        print(json.dumps({"clients": options.live_clients, "times_ms": rows}))
        return 0
    print(told(rows, options.live_clients))
    return 0


def robot_text(driver: str, folder: Path, period: float) -> str:
    """Robot file of a ROSbot-sized robot that plans and commands every `period` [s]."""
    sections: dict[str, dict[str, Any]] = {
        "link": {"url": f"pty:{folder}/{driver}", "driver": driver},
        "board": BOARDS[driver],
        "geometry": {} if driver == "mavlink" else GEOMETRY,
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
        "firmware_bridge.cli.main",
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
    rows = []
    for driver in drivers:
        for rate in rates:
            with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
                folder = Path(name)
                file = folder / "robot.toml"
                file.write_text(robot_text(driver, folder, 1.0 / rate))
                if progress is not None and progress.isatty():
                    progress.write(f"\r\x1b[2K{driver} at {rate:g} Hz ...")
                    progress.flush()
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
    if progress is not None and progress.isatty():
        progress.write("\r\x1b[2K")
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


COMMAND = Command(
    text="Measure latency and jitter of every driver on emulated boards, over pseudo-terminals.",
    examples=(
        "kmpc latency --seconds 10",
        "kmpc latency --drivers roboclaw vesc --rates 50",
        "kmpc latency --flood",
        "kmpc latency --live-clients 50 --seconds 60",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
