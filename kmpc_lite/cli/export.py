"""`kmpc export`: the controller of one robot as C99, for a microcontroller."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from kmpc_lite.cli.command import Command, positive

if TYPE_CHECKING:
    from kmpc_lite.control.problem import NavigationProblem
    from kmpc_lite.model.koopman import KoopmanModel

NOMINAL = "nominal"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("model", help=f"model of `kmpc fit`, or the word {NOMINAL}: obeys its commands exactly")
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="folder that is written")
    add("--scenario", metavar="NAME", help="robot, area and tuning of a scenario file")
    add("--radius", type=positive, metavar="R", help="of the robot [m] (default: 0.15)")
    add("--max-speed", type=positive, metavar="V", help="[m/s] (default: 0.6)")
    add("--max-turn-rate", type=positive, metavar="W", help="[rad/s] (default: 0.785)")
    add("--max-acceleration", type=positive, metavar="A", help="[m/s^2], and 4 A [rad/s^2]")
    add("--horizon", type=int, metavar="N", help="stages of a plan (default: 20)")
    add("--dt", type=positive, metavar="S", help=f"period of the model {NOMINAL} [s] (0.1)")
    add("--float32", action="store_true", help="float throughout: half the memory")


def run(options: argparse.Namespace) -> int:
    """Write the folder, and say what it takes."""
    from kmpc_lite.control.options import ControllerOptions
    from kmpc_lite.embedded.folder import export
    from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle

    if options.model == NOMINAL:
        model = nominal_unicycle(options.dt or 0.1)
    else:
        model = KoopmanModel.load(options.model)
    tuning: ControllerOptions | None = None
    if options.scenario is not None:
        from kmpc_lite.scenario.files import Scenario

        scenario = Scenario.load(options.scenario)
        problem, tuning = scenario.problem(_problem(options, model)), scenario.options
    else:
        problem = _problem(options, model)
    folder = export(model, problem, options.output, float32=options.float32, options=tuning)
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files)
    if options.json:
        print(json.dumps({"folder": str(folder), "files": len(files), "bytes": size}))
        return 0
    print(f"wrote  {folder}: {len(files)} files, {size / 1024:.0f} KB of sources, kmpc.h first")
    print(f"next   make -C {folder} test   # the same answers as Python, on a recorded drive")
    return 0


def _problem(options: argparse.Namespace, model: KoopmanModel) -> NavigationProblem:
    """The problem that a command line asks for, without an area."""
    from kmpc_lite.cli.self_drive import problem_of
    from kmpc_lite.control.problem import NavigationProblem

    base, driven = NavigationProblem(), model.info.get("driven", {})
    v = options.max_speed or driven.get("forward", base.u_max[0])
    omega = options.max_turn_rate or driven.get("turn", base.u_max[1])
    told = {"u_min": (-v, -omega), "u_max": (v, omega)}
    if options.horizon:
        told["horizon"] = options.horizon
    if options.radius:
        told["robot_radius"] = options.radius
    if change := options.max_acceleration:
        told["du_max"] = (change, 4.0 * change)
    return problem_of(model, **told)


COMMAND = Command(
    text="Write the controller of one robot as C99, for a microcontroller.",
    examples=(
        "kmpc export robot.npz -o firmware --radius 0.2 --max-speed 0.8",
        "kmpc export robot.npz -o firmware --scenario map.toml --horizon 10 --float32",
        "kmpc export nominal --dt 0.05 -o firmware && make -C firmware test",
    ),
    add_options=add_options,
    run=run,
)
