"""python -m firmware_bridge.experiments: the paper's experiments on the twin, one command each."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from firmware_bridge.experiments.study import EXPERIMENTS, REPORTING_SEED, prediction_errors, run
from firmware_bridge.messages import BridgeError
from kmpc_lite import KmpcError
from kmpc_lite.cli.measuring import Progress


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m firmware_bridge.experiments",
        description=(
            "The paper's experiments on the digital twin of a ROSbot 2: "
            "data and models are made at the first call."
        ),
        epilog="example:\n  python -m firmware_bridge.experiments a --folder twin",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    kinds = ", ".join(f"{name}: {e.title}" for name, e in EXPERIMENTS.items())
    parser.add_argument(
        "what",
        choices=("model", *EXPERIMENTS, "speed"),
        help=f"model: held-out errors; {kinds}; speed: of the twin",
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("twin"),
        help="for data, models and pictures (default: twin)",
    )
    parser.add_argument("--trials", type=int, help="for each map (default: the experiment's)")
    parser.add_argument(
        "--tuning", action="store_true", help="the tuning seeds instead of the reporting ones"
    )
    parser.add_argument(
        "--robot",
        type=int,
        default=0,
        help="which robot, with a --folder of its own (default: 0, the even one)",
    )
    parser.add_argument(
        "--only",
        default="",
        metavar="WORD",
        help="only controllers whose labels contain this: ours, K-NMPC, NMPC",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object for machines")
    options = parser.parse_args(arguments)

    def bar(name: str) -> Callable[[int, int], None]:
        return Progress(name, quiet=options.json)

    def say(text: str) -> None:
        sys.stdout.write(text + "\n")

    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        if options.what == "speed":
            factor = real_time_factor()
            say(
                json.dumps({"real_time_factor": factor})
                if options.json
                else f"the twin runs {factor:.0f} times as fast as real time"
            )
            return 0
        if options.what == "model":
            rows = prediction_errors(options.folder, bar, options.robot)
            if options.json:
                say(
                    json.dumps(
                        [{"model": n, "model_error": m, "nominal_error": u} for n, m, u in rows]
                    )
                )
                return 0
            say(
                "| model | along [m] | across [m] | heading [rad] | nominal: along, across, "
                "heading | heading to nominal |\n|" + "---|" * 6
            )
            for name, m, u in rows:
                say(
                    f"| {name} | {m[0]:.4f} | {m[1]:.4f} | {m[2]:.4f} | {u[0]:.4f}, {u[1]:.4f}, "
                    f"{u[2]:.4f} | 1/{u[2] / m[2]:.1f} |"
                )
            return 0
        from firmware_bridge.experiments.report import picture, table

        first_seed = 0 if options.tuning else REPORTING_SEED
        trials = run(
            options.folder,
            options.what,
            bar,
            options.trials,
            first_seed,
            options.robot,
            options.only,
        )
        file = options.folder / f"experiment_{options.what}.png"
        picture(file, trials)
        say(
            json.dumps([t.row() for t in trials])
            if options.json
            else f"{table(options.what, trials)}\n\nwrote {file}"
        )
        return 0
    except (BridgeError, KmpcError) as error:
        sys.stderr.write(f"experiments: {error}\n")
        return 2


def real_time_factor(seconds: float = 30.0) -> float:
    """How much faster than real time the twin is on this core, among four obstacles."""
    from kmpc_lite.sim import Scenario
    from kmpc_lite.sim.twin import Twin

    twin = Twin.of(Scenario.load("twin_a1"))
    began = time.process_time()
    for k in range(round(seconds)):
        twin.command(0.3 * (-1) ** k, 0.5)
        twin.advance(1.0)
    return seconds / (time.process_time() - began)


if __name__ == "__main__":
    sys.exit(main())
