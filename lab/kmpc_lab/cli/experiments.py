"""`kmpc experiments`: the paper's experiments on the digital twin, one command each."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

from firmware_bridge.messages import BridgeError
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar

EXPERIMENTS = {
    "a": "four maps",
    "b": "two maps with twice the obstacles",
    "c": "ten maps at 1 Hz, 0.2 to 0.5 s late",
    "d": "the floor changes under way",
}
"""As in `kmpc_lab.experiments.study`."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    kinds = "\n".join(f"{name}: {title}" for name, title in EXPERIMENTS.items())
    add(
        "what",
        choices=("model", *EXPERIMENTS, "speed"),
        metavar="what",
        help=f"model: held-out errors\n{kinds}\n"
        "speed: how much faster than real time the twin runs",
    )
    add(
        "--folder",
        type=Path,
        default=Path("twin"),
        metavar="DIR",
        help="folder for data, models and pictures (default: twin)",
    )
    add("--trials", type=count, metavar="N", help="trials on each map (default: the experiment's)")
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    add(
        "--robot",
        type=int,
        default=0,
        metavar="N",
        help="number of the robot; each needs its own --folder (default: 0, the symmetric one)",
    )
    add(
        "--only",
        default="",
        metavar="WORD",
        help="only controllers whose labels contain this: ours, K-NMPC, NMPC",
    )


def run(options: argparse.Namespace) -> int:
    """Run one experiment, making data and models at the first call."""
    need("the digital twin", "mujoco")
    if options.what in EXPERIMENTS:
        need("the picture of an experiment", "matplotlib")
    options.folder.mkdir(parents=True, exist_ok=True)
    job = {"speed": _speed, "model": _model}.get(options.what, _experiment)
    told, text = job(options)
    print(json.dumps(told) if options.json else text)
    return 0


def _bar(options: argparse.Namespace) -> Callable[[str], ProgressBar]:
    """Progress bars by what is under way."""
    return lambda name: ProgressBar(name, quiet=options.json)


def _speed(options: argparse.Namespace) -> tuple[object, str]:
    factor = real_time_factor()
    told = {"real_time_factor": factor}
    return told, f"the twin runs {factor:.0f} times as fast as real time"


def _model(options: argparse.Namespace) -> tuple[object, str]:
    """Held-out errors of the learned models."""
    from kmpc_lab.experiments.study import prediction_errors

    rows = prediction_errors(options.folder, _bar(options), options.robot)
    told = [{"model": name, "model_error": m, "nominal_error": u} for name, m, u in rows]
    columns = "| model | along [m] | across [m] | heading [rad] "
    lines = [
        f"{columns}| nominal: along, across, heading | heading to nominal |",
        "|" + "---|" * 6,
    ]
    for name, m, u in rows:
        nominal = f"{u[0]:.4f}, {u[1]:.4f}, {u[2]:.4f}"
        errors = f"{m[0]:.4f} | {m[1]:.4f} | {m[2]:.4f}"
        lines.append(f"| {name} | {errors} | {nominal} | 1/{u[2] / m[2]:.1f} |")
    return told, "\n".join(lines)


def _experiment(options: argparse.Namespace) -> tuple[object, str]:
    """Drive all trials of an experiment."""
    from kmpc_lab.experiments.report import picture, table
    from kmpc_lab.experiments.study import REPORTING_SEED
    from kmpc_lab.experiments.study import run as drive

    trials = drive(
        options.folder,
        options.what,
        _bar(options),
        options.trials,
        0 if options.tuning else REPORTING_SEED,
        options.robot,
        options.only,
    )
    file = options.folder / f"experiment_{options.what}.png"
    picture(file, trials)
    return [t.row() for t in trials], f"{table(options.what, trials)}\n\nwrote {file}"


def real_time_factor(seconds: float = 30.0) -> float:
    """How much faster than real time the twin is on this core, among four obstacles."""
    from kmpc_lab.sim.twin import Twin
    from kmpc_lite.scenario.files import Scenario

    twin = Twin.of(Scenario.load("twin_a1"))
    began = time.process_time()
    for k in range(round(seconds)):
        twin.command(0.3 * (-1) ** k, 0.5)
        twin.advance(1.0)
    return seconds / (time.process_time() - began)


COMMAND = Command(
    text="The paper's experiments on the digital twin of a ROSbot 2, driven through the bridge.",
    examples=(
        "kmpc experiments model --folder twin     # data and models: 4 minutes at the first call",
        "kmpc experiments a --folder twin",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
