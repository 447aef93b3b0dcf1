"""`kmpc demo`: the main job from end to end, through files, as a user would do it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import kmpc_lite as kl
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.fit import (
    calibrated,
    load_and_split,
    make_dictionary,
    with_info,
)
from kmpc_lite.cli.output import command_line
from kmpc_lite.cli.simulate import describe, simulate
from kmpc_lite.defaults import SHORTEST_PERIOD

SCENARIO = "four_circles_1"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add(
        "--log",
        type=Path,
        metavar="FILE",
        help="log to learn from (t,x,y,theta,v,omega); "
        "a simulated drive is recorded where not given",
    )
    add(
        "-o",
        "--output",
        type=Path,
        default=Path("out"),
        metavar="DIR",
        help="folder for log, model, run and report, in place of an earlier demo's (default: out)",
    )


def run(options: argparse.Namespace) -> int:
    """Record or read a log, learn, check, drive, report."""
    need("the report of a demo", "matplotlib")
    from kmpc_lite.report import write_report
    from kmpc_lite.sim import Outcome, Scenario

    say = (lambda text: None) if options.json else print
    folder: Path = options.output
    scenario = Scenario.load(SCENARIO)
    log = options.log or folder / "drive.csv"
    if options.log is None:
        slip = f"mean slip {scenario.slip:g}"
        say(f"1  recording 200 s of driving on a floor that slips ({slip}): {log}")
        _record(log, scenario.slip)
    else:
        say(f"1  reading {log}")
    train, held = load_and_split([log], None, None, 0.5, 0)
    model = kl.fit(train, make_dictionary("trig", None, False))
    report = kl.evaluate(model, held, 1.0)
    model, calibration = calibrated(model, held)
    folder.mkdir(parents=True, exist_ok=True)
    model = with_info(model, {"held_out": report.as_dict(), "log": [str(log)]})
    model.save(folder / "robot.npz")
    say(f"2  learned {folder / 'robot.npz'} from {train}")
    say("   " + f"{report}\n{calibration}".replace("\n", "\n   "))
    plant = "learned" if options.log else "slip"
    drive, recorder = simulate(model, scenario, plant, 20, 1)
    drive.save(folder / "run.npz")
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


def _record(log: Path, slip: float) -> None:
    """Record a simulated robot that drives at random."""
    log.parent.mkdir(parents=True, exist_ok=True)
    plant = kl.DifferentialDrive(slip, seed=1)
    data = kl.generate_dataset(
        plant, episodes=20, steps=100, dt=SHORTEST_PERIOD, seed=1, u_max=(0.6, 0.8)
    )
    data.save(log)


COMMAND = Command(
    text="Learn from a drive, check the model, drive past four obstacles, and show it.",
    examples=(
        "kmpc demo",
        "kmpc demo --log run.csv        # your robot's log instead of a simulated one",
    ),
    add_options=add_options,
    run=run,
)
