"""`kmpc latency`: latency and jitter of every driver on emulated boards over pseudo-terminals."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

from firmware_bridge.cli.course import course
from firmware_bridge.messages import BridgeError, ConfigError, LinkError
from firmware_bridge.robot_file import Robot, load_robot
from kmpc_lab.cli.latency_table import (
    MEASURED,
    SCENARIO,
    emulator,
    measure,
    progress_line,
    robot_text,
    table,
)
from kmpc_lite.cli.command import Command, refuse_unread
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import count, positive

NARROW = "walls_door"
"""Where lateness shows: a door of 55 cm."""
SECONDS = 10.0
"""Measuring time, for each row of the table or with and without browsers, by default [s]."""
RATES = (10.0, 50.0)
"""Rates of the table by default [Hz]."""
SHARED = "--seconds", "--drivers", "--rates"
"""The table's options."""
READS: dict[str, tuple[str, ...]] = {
    "live_clients": ("--seconds",),
    "stops": (),
    "flood": (),
    "busy": (),
}
"""Jobs that stand in the table's place, and which of the table's options they read."""
LONG = 3600.0
"""Nothing is to end a drive that is measured before it has been [s]."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add(
        "--seconds",
        type=positive,
        metavar="S",
        help="measuring time for each row of the table, or with and without browsers [s]\n"
        f"(default: {SECONDS:g})",
    )
    add(
        "--drivers",
        nargs="+",
        choices=MEASURED,
        metavar="DRIVER",
        help=f"drivers to measure (default: all): {', '.join(MEASURED)}",
    )
    add(
        "--rates",
        nargs="+",
        type=positive,
        metavar="HZ",
        help="rates of plans and commands [Hz] (default: "
        f"{' '.join(f'{rate:g}' for rate in RATES)})",
    )
    add = parser.add_mutually_exclusive_group().add_argument
    add(
        "--flood",
        nargs="*",
        metavar="WORD",
        help="instead: flood each surface of a bridge that drives, and print what that costs the\n"
        "gate, the standstill and the emergency stop; only floods whose name has a WORD",
    )
    add(
        "--live-clients",
        type=count,
        metavar="N",
        help="instead: drive with N browsers that watch a live page, one of which reads nothing,\n"
        "and without them, in turns of 2 s; prints the times of both and their ratio",
    )
    add(
        "--busy",
        type=count,
        metavar="N",
        help="instead: drive through a door N times each on an idle computer, on a busy "
        "one, "
        "and on a busy one with real-time priority",
    )
    add(
        "--stops",
        type=count,
        metavar="N",
        help="instead: press STOP N times on the live page of an emulated rover that\n"
        "drives, and print how long that takes",
    )


def run(options: argparse.Namespace) -> int:
    """Do the job that is asked for: the table, or one of those in its place."""
    job = next((name for name in READS if getattr(options, name) is not None), None)
    if job is None:
        return _table(options)
    who = f"kmpc latency --{job.replace('_', '-')}"
    refuse_unread("kmpc latency", who, options, SHARED, READS[job])
    jobs = {"live_clients": _watched, "stops": _stops, "flood": _flood, "busy": _busy}
    return jobs[job](options)


def _table(options: argparse.Namespace) -> int:
    """Measure and print the table."""
    drivers, rates = options.drivers or MEASURED, options.rates or RATES
    if "mavlink" in drivers:
        need("the driver mavlink", "pymavlink")
    seconds: float = options.seconds or SECONDS

    def drive(robot: Robot) -> dict[str, Any]:
        from firmware_bridge.runtime.drive import run as drive_robot

        there = replace(robot, control=replace(robot.control, scenario=SCENARIO))
        job = course(there, seconds, seconds)
        return drive_robot(job.robot, job.navigator, job.period, job.origin, None, None)[0]

    rows = measure(drivers, rates, drive, None if options.json else sys.stderr)
    print(json.dumps(rows) if options.json else table(rows))
    return 0


def _flood(options: argparse.Namespace) -> int:
    """Measure and print the table of floods."""
    from kmpc_lab.attacks import floods as known
    from kmpc_lab.attacks import table as attacks

    need("--flood", "pymavlink")
    floods = attacks.chosen(options.flood)
    if not floods:
        names = "; ".join(f"{flood.surface.name}: {flood.name}" for flood in known.FLOODS)
        raise ConfigError(f"--flood {' '.join(options.flood)}: no flood has this in: {names}")
    rows = attacks.measure(floods, progress_line(None if options.json else sys.stderr))
    print(json.dumps([r.as_dict() for r in rows]) if options.json else attacks.table(rows))
    return 0


def _stops(options: argparse.Namespace) -> int:
    """Measure and print what a STOP on the page takes."""
    from kmpc_lab.attacks import presses

    need("--stops", "pymavlink")
    found = presses.run(options.stops)
    print(json.dumps(presses.as_dict(found)) if options.json else presses.told(found))
    return 0


def _watched(options: argparse.Namespace) -> int:
    """Measure and print what browsers cost."""
    from firmware_bridge.cli.live import Showing
    from firmware_bridge.cli.live_options import Views
    from firmware_bridge.live.address import LiveAddress
    from firmware_bridge.runtime.drive import run as drive_robot
    from firmware_bridge.runtime.session import Session
    from kmpc_lab.attacks.watching import Turns, told

    with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
        folder = Path(name)
        file = folder / "robot.toml"
        file.write_text(robot_text("roboclaw", folder, 0.1))
        robot = load_robot(file)
        robot = replace(robot, control=replace(robot.control, scenario=SCENARIO))
        turns = Turns(options.live_clients, options.seconds or SECONDS, folder)
        showing = Showing(Views(LiveAddress(port=0), None), folder / "estop")
        job = course(robot, LONG, LONG, showing.saw)
        showing.job = job
        with emulator(file, folder / "roboclaw"), showing:

            def watch(session: Session) -> AbstractContextManager[None]:
                return turns.watch(session, showing.watch(session, job), showing.links()[0])

            drive_robot(job.robot, job.navigator, job.period, job.origin, None, None, (), watch)
    rows = turns.table()
    times = {"clients": options.live_clients, "times_ms": rows}
    print(json.dumps(times) if options.json else told(rows, options.live_clients))
    return 0


def _busy(options: argparse.Namespace) -> int:
    """Measure and print what a busy computer costs."""
    from kmpc_lab.attacks import busy

    need("--busy", "pymavlink")
    with tempfile.TemporaryDirectory(prefix="kmpc-bridge-", dir=Path.cwd()) as name:
        folder = Path(name)
        file = folder / "robot.toml"
        file.write_text(robot_text("mavlink", folder, 0.1))
        words = ["run", str(file), "--scenario", NARROW, "--arm", "--v-max", "0.5", "--json"]

        def drive(mode: busy.Mode) -> dict[str, Any]:
            command = [sys.executable, "-m", "kmpc_lite.cli.main", *words]
            with emulator(file, folder / "mavlink", "--scenario", NARROW):
                done = subprocess.run(
                    command + ["--realtime"] * mode.realtime,
                    capture_output=True,
                    text=True,
                    check=False,
                )
            if not done.stdout.startswith("{"):
                raise LinkError(f"{mode.name}: the drive did not begin: {done.stderr.strip()}")
            report: dict[str, Any] = json.loads(done.stdout)
            return report

        say = progress_line(None if options.json else sys.stderr)
        rows = busy.measure(drive, options.busy, folder, say)
        say("")
    print(json.dumps(rows) if options.json else busy.told(rows))
    return 0


COMMAND = Command(
    text="Measure latency and jitter of every driver on emulated boards, over pseudo-terminals.",
    examples=(
        "kmpc latency --seconds 10",
        "kmpc latency --drivers roboclaw vesc --rates 50",
        "kmpc latency --flood",
        "kmpc latency --live-clients 50 --seconds 60",
        "kmpc latency --busy 5",
        "kmpc latency --stops 10",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
