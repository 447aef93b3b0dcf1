"""kmpc: learn, drive, study, show.

Every command has --help with an example and --json; bad input ends in one line and exit status 2.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NoReturn

# Worker processes load NumPy anew and inherit this: one BLAS thread each, more only get in each
# other's way.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import kmpc_lite as kl  # noqa: E402
from kmpc_lite.cli.commands import SHORTEST_PERIOD, run_demo, run_fit, run_report, run_simulate  # noqa: E402
from kmpc_lite.cli.measuring import run_bench, run_study  # noqa: E402
from kmpc_lite.sim.maps.families import FAMILIES  # noqa: E402
from kmpc_lite.sim.scenario.files import bundled  # noqa: E402
from kmpc_lite.studies.catalogue import STUDIES  # noqa: E402

DICTIONARIES = {
    "unicycle": "the paper's [1, x, y, theta, cos, sin]",
    "trig": "[1, cos, sin]: the same wherever the robot is; the choice for a real log",
    "hermite1": "Hermite polynomials of degree 1 times [1, cos, sin]",
    "hermite2": "Hermite polynomials of degree 2 times [1, cos, sin]",
}


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        status: int = options.run(options)
        return status
    except kl.KmpcError as error:
        print(f"kmpc: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # whoever read the output has left; what is still buffered must not fail a second time
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"kmpc: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("kmpc: stopped", file=sys.stderr)
        return 130


class OneLineParser(argparse.ArgumentParser):
    """Tells what is wrong with a command line in one line."""

    def error(self, message: str) -> NoReturn:
        """Print one line and exit with status 2."""
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = OneLineParser(
        prog="kmpc", description="Learn a robot from its log and drive it past obstacles to a pose."
    )
    parser.add_argument("--version", action="version", version=f"kmpc_lite {kl.__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")

    def command(name: str, run: Any, text: str, example: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(
            name, help=text, description=text, epilog=f"example:\n{example}", formatter_class=raw
        )
        sub.set_defaults(run=run)
        sub.add_argument(
            "--json", action="store_true", help="print one JSON object instead of text"
        )
        return sub

    p = command(
        "demo",
        run_demo,
        "Learn from a drive, check the model, drive past four obstacles, and show it.",
        "  kmpc demo\n  kmpc demo --log run.csv        # your robot's log instead of a simulated one",
    )
    p.add_argument(
        "--log",
        type=Path,
        help="log to learn from (t,x,y,theta,v,omega); a simulated drive is recorded where not given",
    )
    p.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out"),
        help="folder for log, model, run and report (default: out)",
    )

    p = command(
        "fit",
        run_fit,
        "Learn a model from a log and check it on parts of the log that it has not seen.",
        "  kmpc fit run.csv -o robot.npz\n  kmpc fit run.csv -o robot.npz --dictionary trig --lags 0 1 2 --product",
    )
    p.add_argument(
        "log",
        type=Path,
        nargs="+",
        help=".csv or .npz with t,x,y,theta,v,omega in s, m, rad, m/s, rad/s",
    )
    p.add_argument("-o", "--output", type=Path, required=True, help="model file to write (.npz)")
    p.add_argument(
        "--method",
        choices=("integral", "edmdc"),
        default="integral",
        help="integral (weak form, default) or the paper's edmdc",
    )
    p.add_argument(
        "--dictionary",
        choices=tuple(DICTIONARIES),
        default="trig",
        help="; ".join(f"{k}: {v}" for k, v in DICTIONARIES.items()),
    )
    p.add_argument(
        "--lags",
        type=int,
        nargs="+",
        help="ages of the commands that act, in periods: motor lag and dead time (0 = no lag)",
    )
    p.add_argument(
        "--product",
        action="store_true",
        help="with --lags: let v*omega act too, the side slip of skid-steer robots",
    )
    p.add_argument(
        "--dt",
        type=float,
        help=f"the model's period [s] (default: {SHORTEST_PERIOD}, or the log's own if longer)",
    )
    p.add_argument(
        "--gap",
        type=float,
        help="a longer time between rows [s] ends an episode (default: 2.5 periods)",
    )
    p.add_argument(
        "--holdout",
        type=float,
        default=0.5,
        help="share of the episodes kept for the check (default: 0.5)",
    )
    p.add_argument(
        "--horizon", type=float, default=1.0, help="how far ahead the check looks [s] (default: 1)"
    )
    p.add_argument("--seed", type=int, default=0, help="of the split (default: 0)")

    p = command(
        "simulate",
        run_simulate,
        "Drive a model through a scenario in simulation.",
        "  kmpc simulate --model robot.npz --scenario four_circles_1 --report drive.html\n"
        "  kmpc simulate --scenario mehrez          # the exact unicycle as the model",
    )
    p.add_argument(
        "--model", type=Path, help="model that kmpc fit wrote (default: the nominal unicycle)"
    )
    p.add_argument(
        "--scenario",
        default="four_circles_1",
        help=f"a .toml file, or one of {', '.join(bundled())}",
    )
    p.add_argument(
        "--plant",
        choices=("slip", "learned"),
        default="slip",
        help="slip: the scenario's slipping robot; learned: one that behaves as the model does, noise and lag included",
    )
    p.add_argument("--slip", type=float, help="mean slip ratio instead of the scenario's")
    p.add_argument(
        "--margin",
        type=float,
        help="distance to keep beyond the radii [m] instead of the scenario's",
    )
    p.add_argument("--seed", type=int, help="instead of the scenario's")
    p.add_argument(
        "--timeout",
        type=float,
        help="longest drive [s] instead of the scenario's: robots that turn slowly need more",
    )
    p.add_argument(
        "--horizon",
        type=int,
        default=20,
        help="stages that the controller looks ahead (default: 20)",
    )
    p.add_argument(
        "--no-adaptation",
        action="store_true",
        help="leave the model as it was learned while driving",
    )
    p.add_argument(
        "--iterations",
        type=int,
        default=1,
        help="SQP passes per step: 1 is real time, more converge (default: 1)",
    )
    p.add_argument("-o", "--output", type=Path, help="run file to write (.npz)")
    p.add_argument("--report", type=Path, help="report to write (.html)")

    p = command(
        "report",
        run_report,
        "Show a run as one HTML page, or as PNG pictures.",
        "  kmpc report run.npz -o run.html\n  kmpc report run.npz --pictures figures",
    )
    p.add_argument("file", type=Path, help="run that kmpc simulate wrote (.npz)")
    p.add_argument(
        "-o", "--output", type=Path, help="page to write (default: the run's name with .html)"
    )
    p.add_argument("--model", type=Path, help="model of the run, to show how it was fitted")
    p.add_argument("--pictures", type=Path, help="folder to write PNG pictures to")

    p = command(
        "study",
        run_study,
        "Reproduce the paper's table 1 beside ours, or drive random maps: plain ones, with motors that lag, noisy poses, floors that "
        "change (adaptation), models of another floor (mismatch); or force failures (faults). IPOPT's rows need the extra peers.",
        "  kmpc study table1\n  kmpc study table1 --trials 100 --json > table1.json\n"
        "  kmpc study maps --maps 100 --records maps.jsonl --failures failures\n"
        "  kmpc study maps --families dense trap moving --controllers 'everything on' --slips 0.1\n"
        "  kmpc study lag --records lag.jsonl --failures failures\n"
        "  kmpc study faults --maps 10",
    )
    told = [
        *(f"{name}: {study.text}" for name, study in STUDIES.items()),
        "faults: solver, clock, warm start and poses that fail",
    ]
    p.add_argument("study", choices=("table1", *STUDIES, "faults"), help="; ".join(told))
    p.add_argument(
        "--trials", type=int, default=5, help="runs per cell (default: 5, as in the paper)"
    )
    p.add_argument(
        "--scenario",
        default="four_circles_1",
        help="map of table1 (default: four_circles_1); its slip and seed are replaced",
    )
    p.add_argument("--maps", type=int, default=100, help="maps of each family (default: 100)")
    p.add_argument(
        "--families",
        nargs="+",
        choices=FAMILIES,
        default=["open"],
        help="families of random maps (default: open)",
    )
    p.add_argument(
        "--slips",
        type=float,
        nargs="+",
        help="mean slip ratios (default: the study's, the paper's eight for maps)",
    )
    p.add_argument(
        "--controllers",
        nargs="+",
        help="rows whose labels contain one of these (default: the study's)",
    )
    p.add_argument(
        "--trained-at",
        type=float,
        help="slip at which models are learned (default: the one that is driven; mismatch: 0.1)",
    )
    p.add_argument(
        "--records",
        type=Path,
        help="file to which each drive is added; a study that was stopped goes on from it (.jsonl)",
    )
    p.add_argument(
        "--failures", type=Path, help="folder for scenario files of the drives that failed"
    )
    p.add_argument(
        "--tuning", action="store_true", help="the tuning seeds instead of the reporting ones"
    )
    p.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )

    p = command(
        "bench",
        run_bench,
        "Time a step on this machine, beside whichever peers are installed, on the same states in one run.",
        "  kmpc bench\n  kmpc bench --drives 40 --picture bench.png\n  kmpc bench --scaling\n  kmpc bench --loop 100 --seconds 600\n"
        "  kmpc bench --quality\n  kmpc bench --fit",
    )
    p.add_argument(
        "--drives", type=int, default=20, help="recorded drives of 60 states (default: 20)"
    )
    p.add_argument(
        "--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones"
    )
    p.add_argument("--only", nargs="+", help="contenders whose names contain one of these words")
    p.add_argument("--picture", type=Path, help="picture of the distributions to write (.png)")
    p.add_argument(
        "--scaling",
        action="store_true",
        help="how the time grows with horizon and obstacles, ours only",
    )
    p.add_argument(
        "--settings",
        action="store_true",
        help="the study behind the solver's settings, on tuning drives",
    )
    p.add_argument(
        "--solvers",
        action="store_true",
        help="every QP solver that qpsolvers finds here, beside OSQP, on the same states",
    )
    p.add_argument(
        "--loop",
        type=float,
        metavar="HZ",
        help="run the control loop at this rate with the other cores busy",
    )
    p.add_argument(
        "--seconds", type=float, default=600.0, help="how long, with --loop (default: 600)"
    )
    p.add_argument(
        "--no-load", action="store_true", help="with --loop: leave the other cores alone"
    )
    p.add_argument(
        "--budget", type=float, metavar="S", help="with --loop: the controller's time_budget"
    )
    p.add_argument(
        "--quality",
        action="store_true",
        help="what the passes converge to, against IPOPT, 50 states of each drive",
    )
    p.add_argument(
        "--fit",
        action="store_true",
        help="time and memory of fitting 1,000,000 samples, against a bare Gram product",
    )
    p.add_argument(
        "--install-acados",
        action="store_true",
        help="fetch the acados peer (x86-64 Linux wheel, about 20 MB) and stop",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
