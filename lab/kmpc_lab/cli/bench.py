"""`kmpc bench`: step times on this machine, beside whichever peers are installed."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kmpc_lite.cli.command import Command, ProgressBar, count, positive, refuse_unread

DRIVES, SECONDS = 20, 600.0
"""Recorded drives, and how long the loop runs [s], if nothing else is asked for."""
QUALITY_STEPS = 50  # states of a recorded drive that IPOPT solves until it converges
SHARED = ("--drives", "--tuning", "--only", "--seconds", "--no-load", "--budget")
"""Options that not every job reads."""
RECORDED = ("--drives", "--tuning")  # what a job reads that records drives


@dataclass(frozen=True)
class Job:
    """One thing that is measured, and the options that it reads; others are refused."""

    measure: Callable[[argparse.Namespace], tuple[Any, str]]
    """Gives what was found, for machines and as text."""
    reads: tuple[str, ...]  # options beside its own
    text: str = ""  # its line of the help


def _compare(options: argparse.Namespace) -> tuple[Any, str]:
    """Step times of all contenders, on the same states."""
    from kmpc_lab.bench import steps

    bars = [ProgressBar(name, quiet=options.json) for name in ("bench", "bench, lidar")]
    told = steps.as_dict(*steps.compare(_drives(options), _seed(options), options.only, *bars))
    return told, steps.format_tables(told)


def _solvers(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench import steps

    bar = ProgressBar("solvers", quiet=options.json)
    told = steps.as_dict(*steps.compare_solvers(_drives(options), _seed(options), bar))
    return told, steps.format_tables(told)


def _quality(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.drives import learned_model, record
    from kmpc_lab.bench.quality import as_dicts, compare, format_comparison
    from kmpc_lab.peers.ipopt import papers_problem

    model, problem = learned_model(), papers_problem()
    drives = record(model, problem, _drives(options), _seed(options), QUALITY_STEPS)
    bar = ProgressBar("quality", quiet=options.json)
    compared = compare(model, problem, drives, progress=bar)
    return as_dicts(compared), format_comparison(compared)


def _loop(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.drives import learned_model
    from kmpc_lab.bench.loop import run_loop
    from kmpc_lab.peers.ipopt import papers_problem

    seconds = SECONDS if options.seconds is None else options.seconds
    how = options.loop, seconds, _seed(options), not options.no_load, options.budget
    bar = ProgressBar("real-time loop", quiet=options.json)
    result = run_loop(learned_model(), papers_problem(), *how, bar)
    return result.as_dict(), str(result)


def _install_acados(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.peers.acados import install

    folder = install()
    return {"acados": str(folder)}, f"acados is in {folder}"


def _seed(options: argparse.Namespace) -> int:
    """First seed of the recorded drives."""
    from kmpc_lab.bench.drives import REPORTING_SEED, TUNING_SEED

    return TUNING_SEED if options.tuning else REPORTING_SEED


def _drives(options: argparse.Namespace) -> int:
    return DRIVES if options.drives is None else int(options.drives)


COMPARISON = Job(_compare, (*RECORDED, "--only"))  # what is done if no job is named
JOBS = {
    "--solvers": Job(
        _solvers,
        RECORDED,
        "time every QP solver that qpsolvers finds here beside OSQP, on the same states",
    ),
    "--quality": Job(
        _quality,
        RECORDED,
        f"compare what the passes converge to with IPOPT, on {QUALITY_STEPS} states of each drive",
    ),
    "--install-acados": Job(
        _install_acados, (), "fetch the acados peer (x86-64 Linux wheel, about 20 MB) and stop"
    ),
}
LOOP = Job(
    _loop,
    ("--tuning", "--seconds", "--no-load", "--budget"),
    "run the control loop at this rate with the other cores busy",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("--drives", type=count, metavar="N", help=f"recorded drives (default: {DRIVES})")
    add("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    text = "time only contenders whose names contain one of these words"
    add("--only", nargs="+", metavar="WORD", help=text)
    what = parser.add_mutually_exclusive_group()
    for option, job in JOBS.items():
        what.add_argument(option, dest="job", action="store_const", const=option, help=job.text)
    what.add_argument("--loop", type=positive, metavar="HZ", help=LOOP.text)
    text = f"with --loop: for how long [s] (default: {SECONDS:g})"
    add("--seconds", type=positive, metavar="S", help=text)
    add("--no-load", action="store_true", help="with --loop: leave the other cores alone")
    text = "with --loop: the controller's time_budget [s]"
    add("--budget", type=positive, metavar="S", help=text)


def run(options: argparse.Namespace) -> int:
    """Measure what was asked for."""
    name, job = options.job, JOBS.get(options.job, COMPARISON)
    if options.loop:
        name, job = "--loop", LOOP
    who = " ".join(filter(None, ("kmpc bench", name)))
    refuse_unread("kmpc bench", who, options, SHARED, job.reads)
    told, text = job.measure(options)
    print(json.dumps(told) if options.json else text)
    return 0


COMMAND = Command(
    text="Time a step on this machine, beside the peers that are installed: on the same states,\n"
    "in turns step by step with 10 ms of sleep before each, as a robot's caches find them.",
    examples=(
        "kmpc bench",
        "kmpc bench --solvers",
        "kmpc bench --loop 100 --seconds 600",
        "kmpc bench --quality",
    ),
    add_options=add_options,
    run=run,
)
