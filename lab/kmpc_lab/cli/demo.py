"""`kmpc demo`: the main job from end to end, by the commands that a user would type.

The emulated rover is recorded, learned and driven through its link; with a log of one's own, or
without pymavlink, a simulated robot drives without one.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any

from firmware_bridge.messages import BridgeError, LinkError
from firmware_bridge.sensors.lidar.options import LIDARS
from kmpc_lite.cli.command import (
    Command,
    build_parser,
    is_installed,
    known_commands,
    need,
    pip_line,
    positive,
)
from kmpc_lite.cli.main import INTERRUPTED
from kmpc_lite.defaults import SHORTEST_PERIOD

SCENARIO, FENCE = "four_circles_1", (-2, -2, 2, 2)
"""What is driven, and its bounds [m]: there the rover may drive at random."""
LAGS = (0, 1, 2, 3)
"""Ages of the commands that act [periods], as `kmpc fit --lags` takes them: the rover obeys late,
and a drive this short does not tell by itself how late it turns."""
HOLD = 20.0
"""How long a rover that sees waits for plans on a busy machine until it is given back [s]: it would
stand there until the time is up."""
PATIENCE = 60.0  # give up driving after so long [s]
LIDAR = "ld06"  # default lidar of the rover
START_TIME = 20.0  # how long an emulator may take to start [s]
OWN_FILES = (
    *("rover", "lidar", "drive.csv", "drive.tlog", "robot.npz", "report.html"),
    *("run/drive.csv", "run/drive.tlog", "run/drive.mcap"),
)
"""What a demo of the rover writes into its folder, and replaces the next time."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    text = (
        "log of your robot, which is learned from and driven on a map for its speed\n"
        "(default: a drive is recorded)"
    )
    add("--log", type=Path, metavar="FILE", help=text)
    text = "folder for log, model, run and report, in place of an earlier demo's (default: out)"
    add("-o", "--output", type=Path, default=Path("out"), metavar="DIR", help=text)
    text = (
        "rover: an emulated ArduPilot rover behind a pseudo-terminal, as a real one would be "
        "(default, where pymavlink is installed)\nsimulated: without a link"
    )
    add("--robot", choices=("rover", "simulated"), help=text)
    text = "length of the rover's random drive, which is learned from [s] (default: 70)"
    add("--seconds", type=positive, metavar="S", default=70.0, help=text)
    text = "seed of the rover's random driving and slip (default: 0)"
    add("--seed", type=int, default=0, help=text)
    text = (
        "drive by sight alone: the rover carries a lidar, and no map is given\n"
        f"({', '.join(LIDARS)}; default: {LIDAR})"
    )
    add("--lidar", choices=LIDARS, metavar="NAME", nargs="?", const=LIDAR, help=text)


def run(options: argparse.Namespace) -> int:
    """Record, learn, drive, report; status 1 where the goal was not reached."""
    if options.log and options.robot == "rover":
        raise BridgeError("--log: the rover records a log of its own; leave --robot rover out")
    need("the report of a demo", "matplotlib")
    simulated = options.robot == "simulated" or options.log is not None
    if simulated and options.lidar:
        raise BridgeError("--lidar: only the emulated rover carries one: --robot rover")
    if options.robot is None and not simulated and not options.lidar:
        simulated = not is_installed("pymavlink")
        if simulated and not options.json:
            print(f"without the emulated rover, which needs {pip_line('pymavlink')}")
    if not simulated:
        need("the emulated rover", "pymavlink")
    folder: Path = options.output
    folder.mkdir(parents=True, exist_ok=True)
    try:
        demo = Demo(folder, options.json)
        return demo.simulated(options.log) if simulated else demo.rover(options)
    finally:
        with suppress(OSError):  # it holds something
            folder.rmdir()


class Demo:
    """Commands one after the other, whose files lie in a folder."""

    def __init__(self, folder: Path, quiet: bool) -> None:
        self._folder, self._quiet = folder, quiet
        self._log, self._model = folder / "drive.csv", folder / "robot.npz"
        self._run = folder / "run"
        self._told: dict[str, dict[str, Any]] = {}

    def _say(self, text: str) -> None:
        if not self._quiet:
            print(text, flush=True)

    def _do(self, *words: object) -> int:
        """Run a command as if it was typed; its exit status."""
        given = [str(word) for word in words]
        self._say(f"{len(self._told) + 1}  kmpc {shlex.join(given)}")
        given += ["--json"] if self._quiet else []
        parsed = build_parser(known_commands(), given).parse_args(given)
        with redirect_stdout(StringIO()) if self._quiet else nullcontext() as out:
            status: int = parsed.run(parsed)
        self._told[given[0]] = {} if out is None else json.loads(out.getvalue())
        return status

    def rover(self, options: argparse.Namespace) -> int:
        """Record, learn and drive the emulated rover through its link."""
        for name in OWN_FILES:
            (self._folder / name).unlink(missing_ok=True)
        link, lidar = f"pty:{self._folder / 'rover'}", f"pty:{self._folder / 'lidar'}"
        robot = "--driver", "mavlink", "--link", link, "--arm"
        served = "mavlink", "--link", link, "--scenario", SCENARIO, "--seed", options.seed
        sees: tuple[str, ...] = ()
        by_sight: tuple[object, ...] = ()
        if options.lidar:
            sees = "--lidar", options.lidar, "--lidar-link", lidar
            # the map has no walls around it: beams that end nowhere have nothing before them
            free = "--set", 'lidar.no_return="free"', "--set", f"safety.hold={HOLD:g}"
            by_sight = *sees, *free, "--by-sight"
        random = "--excite", "--geofence", *FENCE, "--seconds", f"{options.seconds:g}"
        how = "--seed", options.seed, "--output", self._folder / "drive"
        begun = time.monotonic()
        with emulator(self._folder / "rover", *served):
            status = self._do("record", *robot, *random, *how)
        if time.monotonic() - begun < options.seconds:  # Ctrl-C ends a recording, and keeps it
            status = INTERRUPTED
        if status == 0:
            status = self._do("fit", self._log, "-o", self._model, "--lags", *LAGS)
        if status != 0:
            return self._end(status)
        course = "--model", self._model, "--scenario", SCENARIO, "--seconds", f"{PATIENCE:g}"
        with emulator(self._folder / "rover", *served, *sees):
            status = self._do("run", *robot, *course, *by_sight, "--record", self._run)
        return self._end(status)

    def simulated(self, log: Path | None) -> int:
        """Record a simulated robot or take a log, learn, and drive it: without a link."""
        from kmpc_lab.cli.own_course import course_for
        from kmpc_lite.learn.loading import load_logs
        from kmpc_lite.model.koopman import KoopmanModel
        from kmpc_lite.scenario.files import Scenario

        scenario: object = SCENARIO
        if log is None:
            slip = Scenario.load(SCENARIO).slip
            self._say(f"recording 200 s of driving on a floor that slips (mean slip {slip:g})")
            _record_simulated(self._log, slip)
        if status := self._do("fit", log or self._log, "-o", self._model):
            return self._end(status)
        if log is not None:
            scenario = self._folder / "map.toml"
            course, text = course_for(
                KoopmanModel.load(self._model), load_logs([log]), Scenario.load(SCENARIO)
            )
            scenario.write_text(course.to_toml())
            self._say(f"{scenario}: {text}")
        plant = "slip" if log is None else "learned"
        how = "--model", self._model, "--plant", plant, "--record", self._run
        return self._end(self._do("simulate", scenario, *how))

    def _end(self, status: int) -> int:
        """Make the report of a drive that ended with a status, if there was one; tell all."""
        told: dict[str, Any] = {"outcome": "stopped"}
        if status in (0, 1) and (self._run / "drive.mcap").is_file():
            from kmpc_lab.recording.drive_file import load_drive

            page = self._folder / "report.html"
            self._do("report", self._run, "--model", self._model, "-o", page)
            self._say(f"open {page.resolve()}")
            told = {"report": str(page), "held_out": self._told["fit"].get("held_out")}
            told |= load_drive(self._run).summary()
        else:
            self._say("no report: it did not drive to the end")
        if self._quiet:
            more = {name: self._told[name] for name in ("record", "run") if name in self._told}
            print(json.dumps({**told, **more}))
        return status


@contextmanager
def emulator(link: Path, *words: object) -> Iterator[None]:
    """Run `kmpc emulate` in another process, once its pseudo-terminal is there."""
    command = [sys.executable, "-m", "kmpc_lite.cli.main", "emulate", *map(str, words)]
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


def _record_simulated(log: Path, slip: float) -> None:
    """Record a simulated robot that drives at random."""
    from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset

    plant, fastest = DifferentialDrive(slip, seed=1), (0.6, 0.8)
    generate_dataset(plant, episodes=20, steps=100, dt=SHORTEST_PERIOD, seed=1, u_max=fastest).save(
        log
    )


COMMAND = Command(
    text="Learn from a drive, check the model, drive past four obstacles, and show it.",
    examples=(
        "kmpc demo                      # an emulated ArduPilot rover, about two minutes",
        "kmpc demo --lidar              # by sight: the controller sees obstacles only by lidar",
        "kmpc demo --robot simulated    # without a link, a few seconds",
        "kmpc demo --log run.csv        # learn from your robot's log instead",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
