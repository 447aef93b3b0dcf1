"""`kmpc demo`: the main job from end to end, through files, as a user would do it.

The emulated rover is recorded, learned and driven through its link; with a log of one's own, or
without pymavlink, a simulated robot drives without one.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import kmpc_lite as kl
from firmware_bridge.integration.course import course
from firmware_bridge.integration.recording import NAME, recorder_of
from firmware_bridge.messages import BridgeError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.safety.gate_settings import TICK
from firmware_bridge.safety.gate_table import Reason
from firmware_bridge.sensors.lidar.options import LIDARS
from kmpc_lab.cli.simulate import describe, simulate
from kmpc_lab.cli.stage import SCENARIO, Stage, emulator, robot_text
from kmpc_lite.cli.command import Command, is_installed, need, pip_line, positive
from kmpc_lite.cli.fit import tell_learned
from kmpc_lite.cli.output import command_line, watching
from kmpc_lite.defaults import SHORTEST_PERIOD

if TYPE_CHECKING:
    from kmpc_lab.sim.closed_loop import Run
    from kmpc_lite.learn.learning import Learned

PERIOD = 0.1
"""Of controller and rows [s]."""
COMMANDS = {"command_period": TICK}
"""Commands go out faster than plans are made."""
LAGS = [0, 1, 2, 3]
"""Ages of the commands that act [periods], as `kmpc fit --lags` takes them: the rover obeys late,
and a drive this short does not tell by itself how late it turns."""
SETTLE = 1.0
"""How long the goal must be held [s]."""
HOLD, MUCH = 20.0, 0.05
"""How long the emulated rover waits for plans on a busy machine until it is given back [s], and the
share of the time with late plans that is reported."""
LIDAR = "ld06"
"""Default lidar of the rover."""
PATIENCE = 60.0
"""Give up driving after so long [s]."""
WAIT = 60.0
"""Give up waiting for the rover to be armed after so long [s]."""
OWN_FILES = (
    "drive.csv",
    "drive.tlog",
    "robot.npz",
    f"run/{NAME}.csv",
    f"run/{NAME}.tlog",
    f"run/{NAME}.mcap",
    "report.html",
)
"""What a demo writes into its folder, and replaces the next time."""


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
    text = "length of the rover's random drive, which is learned from [s] (default: 50)"
    add("--seconds", type=positive, metavar="S", default=50.0, help=text)
    text = "seed of the rover's random driving and slip (default: 0)"
    add("--seed", type=int, default=0, help=text)
    text = (
        "drive by sight alone: the rover carries a lidar, and no map is given\n"
        f"({', '.join(LIDARS)}; default: {LIDAR})"
    )
    add("--lidar", choices=LIDARS, metavar="NAME", nargs="?", const=True, help=text)


def run(options: argparse.Namespace) -> int:
    """Record, learn, drive, report; status 1 where the goal was not reached."""
    if options.log and options.robot == "rover":
        raise BridgeError("--log: the rover records a log of its own; leave --robot rover out")
    need("the report of a demo", "matplotlib")
    if options.log or options.robot == "simulated":
        if options.lidar is not None:
            raise BridgeError("--lidar: only the emulated rover carries one: --robot rover")
        return simulated(options)
    if options.robot is None and options.lidar is None and not is_installed("pymavlink"):
        if not options.json:
            print(f"without the emulated rover, which needs {pip_line('pymavlink')}")
        return simulated(options)
    need("the emulated rover", "pymavlink")
    say = (lambda text: None) if options.json else partial(print, flush=True)
    lidar = LIDAR if options.lidar is True else options.lidar
    report, status = demo(options.output, options.seconds, options.seed, say, options.json, lidar)
    if options.json:
        print(json.dumps(report))
    return status


def demo(
    folder: Path,
    seconds: float,
    seed: int,
    say: Callable[[str], None],
    quiet: bool = True,
    lidar: str | None = None,
) -> tuple[dict[str, Any], int]:
    """Record, learn, drive, report; gives the report and the exit status.

    Files of an earlier demo in the folder are replaced. The lidar, if one is named, is the drive's
    only source of obstacles; `say` receives a line per phase.
    """
    from firmware_bridge.runtime.drive import DONE, INTERRUPTED, NOT_DONE, SIGNALS
    from kmpc_lab.report.html import write_report
    from kmpc_lab.sim.closed_loop import Outcome
    from kmpc_lite.learn.loading import load_logs
    from kmpc_lite.scenario.files import Scenario

    folder.mkdir(parents=True, exist_ok=True)
    for name in OWN_FILES:
        (folder / name).unlink(missing_ok=True)
    scenario = Scenario.load(SCENARIO)
    with tempfile.TemporaryDirectory(prefix="kmpc-bridge-") as name:
        file = Path(name) / "rover.toml"
        file.write_text(robot_text("mavlink", Path(name), PERIOD))
        rover = partial(emulator, file, Path(name) / "mavlink", "--seed", str(seed))
        stage = Stage(file, rover, scenario, folder, say, quiet, lidar)
        recorded, status = _record(stage, seconds, seed)
        if recorded["loop"]["stop_reason"] in SIGNALS:
            say("stopped: no model, no report")
            return {"outcome": "stopped", **recorded}, INTERRUPTED
        if status != DONE:
            why = "; ".join(recorded["problems"]) or "the rover did not drive"
            raise BridgeError(f"{folder / 'drive.csv'}: nothing was recorded: {why}")
        log = folder / "drive.csv"
        learned = learn_log(log, load_logs([log]), folder / "robot.npz", say, LAGS)
        driven, report, status = _drive(stage)
    if driven is None:
        say("stopped: no report")
        return report, status
    say(f"   {describe(driven)}{_busy(report['loop'])}")
    page = folder / "report.html"
    write_report(
        page, driven, model=learned.model, fit_report=learned.report, command=command_line()
    )
    say(f"4  open {page.resolve()}")
    result = {
        "report": str(page),
        "rows": recorded["rows"],
        "held_out": learned.report.as_dict(),
        "link": report["loop"],
        **driven.summary(),
    }
    return result, DONE if driven.outcome is Outcome.REACHED else NOT_DONE


def _busy(loop: dict[str, Any]) -> str:
    """Tell where plans came too late for much of the time; or nothing."""
    late = loop["reasons"].get(Reason.COMMAND.value, 0) / max(loop["ticks"], 1)
    if late < MUCH:
        return ""
    return f"\n   this computer was busy: for {100.0 * late:.0f} % of the time plans were too late"


def _record(stage: Stage, seconds: float, seed: int) -> tuple[dict[str, Any], int]:
    """Drive the rover at random and record that."""
    from firmware_bridge.runtime.record_drive import RandomDriving, record

    log = stage.folder / "drive.csv"
    stage.say(
        f"1  recording {seconds:g} s of random driving of an emulated ArduPilot rover over a "
        f"pseudo-terminal: {log}"
    )
    # the emulated floor is empty: the whole map is free for random driving
    geofence = {"geofence": stage.scenario.bounds}
    robot = load_robot(stage.file, {"control": COMMANDS, "safety": geofence})

    def line() -> str:
        rows = log.read_bytes().count(b"\n") - 2 if log.exists() else 0
        if rows <= 0:
            return "   waiting for the rover to be armed"
        return f"   {min(seconds, rows * PERIOD):.0f} of {seconds:g} s recorded"

    with stage.rover(), watching(line, stage.quiet):
        report, status = record(
            robot,
            str(stage.folder / "drive"),
            seconds,
            period=PERIOD,
            excitation=RandomDriving(seed=seed),
            out=None,
        )
    stage.say(f"   {report['rows']} rows every {PERIOD:g} s")
    return report, status


def _drive(stage: Stage) -> tuple[Run | None, dict[str, Any], int]:
    """Drive the scenario with what was learned; no run where a signal came."""
    from firmware_bridge.runtime.drive import INTERRUPTED
    from firmware_bridge.runtime.drive import run as drive
    from kmpc_lab.recording.drive_file import load_drive

    eyes, how = stage.eyes, f"by its lidar ({stage.lidar}) alone, " if stage.lidar else ""
    stage.say(f"3  driving {stage.scenario.name} with it, {how}over a pseudo-terminal again")
    control = {**COMMANDS, "model": str(stage.folder / "robot.npz"), "scenario": SCENARIO}
    control["map"] = not eyes
    # by sight a plan takes longer: where a busy machine makes some late, the rover waits for them;
    # one that is given back would stand there until the patience ends
    safety = {"hold": HOLD} if eyes else {}
    robot = load_robot(stage.file, {"control": control, "lidar": eyes, "safety": safety})
    job = course(robot, SETTLE, PATIENCE, wait=WAIT)
    for note in job.notes:
        stage.say(f"   {note}")
    folder = stage.folder / "run"
    folder.mkdir(exist_ok=True)

    def line() -> str:
        return f"   driving for {job.navigator.elapsed(time.monotonic()):.0f} s"

    with stage.rover(*stage.seeing), watching(line, stage.quiet):
        report, status = drive(
            job.robot,
            job.navigator,
            job.period,
            job.origin,
            str(folder / NAME),
            None,
            recorder=recorder_of(job, command_line()),
        )
    if status == INTERRUPTED:
        return None, report, INTERRUPTED
    if not job.navigator.drove:
        raise BridgeError("the rover did not drive: no command passed the gate")
    driven = load_drive(folder)
    driven.info["plant"] = "emulated ArduPilot rover over a pty; poses as its EKF tells them"
    return driven, report, status


def simulated(options: argparse.Namespace) -> int:
    """Record or read a log, learn, check, drive, report: without a link."""
    from kmpc_lab.cli.own_course import course_for
    from kmpc_lab.report.html import write_report
    from kmpc_lab.sim.closed_loop import Outcome
    from kmpc_lite.learn.loading import load_logs
    from kmpc_lite.scenario.files import Scenario

    say = (lambda text: None) if options.json else print
    folder: Path = options.output
    scenario = Scenario.load(SCENARIO)
    log = options.log or folder / "drive.csv"
    if options.log is None:
        slip = f"mean slip {scenario.slip:g}"
        say(f"1  recording 200 s of driving on a floor that slips ({slip}): {log}")
        _record_simulated(log, scenario.slip)
    else:
        say(f"1  reading {log}")
    data = load_logs([log])
    learned = learn_log(log, data, folder / "robot.npz", say)
    model, report = learned.model, learned.report
    plant, problem = "slip", kl.NavigationProblem(dt=model.dt)
    if options.log:
        course = course_for(learned, data, scenario)
        plant, problem, scenario = "learned", course.problem, course.scenario
        say("   " + course.text.replace("\n", "\n   "))
    drive, recorder = simulate(model, scenario, plant, problem, None)
    recorder.write(folder / "run", drive)
    drive = recorder.with_details(drive)
    say(f"3  drove {scenario.name}: {describe(drive)}")
    page = folder / "report.html"
    write_report(page, drive, model=model, fit_report=report, command=command_line())
    if options.json:
        print(json.dumps({"report": str(page), "held_out": report.as_dict(), **drive.summary()}))
    else:
        print(f"4  open {page.resolve()}")
    return 0 if drive.outcome is Outcome.REACHED else 1


def learn_log(
    log: Path,
    data: kl.Dataset,
    output: Path,
    say: Callable[[str], None],
    lags: Literal["auto"] | Sequence[int] = "auto",
) -> Learned:
    """Learn from a log as `kmpc fit` does, write the model, and tell how good it is."""
    from kmpc_lite.learn.learning import LearningOptions, learn
    from kmpc_lite.learn.provenance import read_vehicle

    learned = learn(data, [log], LearningOptions(lags=lags), read_vehicle([log]))
    output.parent.mkdir(parents=True, exist_ok=True)
    learned.model.save(output)
    say(f"2  learned {output} from {learned.train}")
    warnings = (f"warn   {text}" for text in learned.facts.get("warnings", ()))
    text = "\n".join([*tell_learned(learned, []), *warnings])
    say("   " + text.replace("\n", "\n   "))
    return learned


def _record_simulated(log: Path, slip: float) -> None:
    """Record a simulated robot that drives at random."""
    from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset

    log.parent.mkdir(parents=True, exist_ok=True)
    plant = DifferentialDrive(slip, seed=1)
    data = generate_dataset(
        plant, episodes=20, steps=100, dt=SHORTEST_PERIOD, seed=1, u_max=(0.6, 0.8)
    )
    data.save(log)


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
