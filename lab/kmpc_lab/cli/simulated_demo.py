"""`kmpc demo`: the main job from end to end, through files, as a user would do it."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import kmpc_lite as kl
from kmpc_lab.cli.simulate import describe, simulate
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.fit import tell_learned
from kmpc_lite.cli.output import command_line
from kmpc_lite.defaults import SHORTEST_PERIOD

if TYPE_CHECKING:
    from kmpc_lite.learn.learning import Learned

SCENARIO = "four_circles_1"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add(
        "--log",
        type=Path,
        metavar="FILE",
        help="log of your robot, which is learned from and driven on a map for its speed\n"
        "(default: a drive is recorded)",
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
    from kmpc_lab.cli.own_course import course_for
    from kmpc_lab.report import write_report
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
        _record(log, scenario.slip)
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


def learn_log(
    log: Path,
    data: kl.Dataset,
    output: Path,
    say: Callable[[str], None],
    lags: Literal["auto"] | Sequence[int] = "auto",
) -> Learned:
    """Learn from a log as `kmpc fit` does, write the model, and tell how good it is.

    Parameters
    ----------
    log : Path
        The file.
    data : Dataset
        What it holds.
    output : Path
        The model's file.
    say : callable
        Receives the lines.
    lags : "auto" or sequence of int
        As those of `kmpc fit`.
    """
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


def _record(log: Path, slip: float) -> None:
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
        "kmpc demo",
        "kmpc demo --log run.csv        # your robot's log instead of a simulated one",
    ),
    add_options=add_options,
    run=run,
)
