"""What `kmpc bench` measures: each job, and the options that it reads."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import kmpc_lite as kl
from kmpc_lite.cli.progress import ProgressBar

DRIVES, SECONDS = 20, 600.0
"""Recorded drives, and how long the loop runs [s], if nothing else is asked for."""
STEPS = 60
"""States of a recorded drive."""
QUALITY_STEPS = 50
"""States of a recorded drive that IPOPT solves until it converges."""
OBSTACLES = 4


@dataclass(frozen=True)
class Job:
    """One thing that is measured, and the options that it reads; others are refused."""

    measure: Callable[[argparse.Namespace], tuple[Any, str]]
    """Gives what was found, for machines and as text."""
    reads: tuple[str, ...]
    """Options beside its own."""
    text: str = ""
    """Its line of the help."""


def _compare(options: argparse.Namespace) -> tuple[Any, str]:
    """Step times of all contenders, on the same states."""
    from kmpc_lab import bench
    from kmpc_lab.bench.boards import this_machine
    from kmpc_lab.bench.drives import learned_model
    from kmpc_lab.bench.measure import import_times
    from kmpc_lab.peers.paper import papers_problem
    from kmpc_lab.studies.contenders import (
        BENCH_CONTENDERS,
        BENCH_FULL_CONTENDERS,
        FULL_STEP,
        PAPER_FORM,
    )

    model, problem = learned_model(), papers_problem()
    bar = ProgressBar("bench", quiet=options.json)
    tables = []
    left_out: dict[str, str] = {}
    for title, everyone, driver in (
        (
            "the paper's problem, on the states of a plain controller's drives",
            BENCH_CONTENDERS,
            PAPER_FORM,
        ),
        (
            "guidance and margins on, on the states of its own drives; "
            "IPOPT solves the paper's problem there",
            BENCH_FULL_CONTENDERS,
            FULL_STEP,
        ),
    ):
        words = [word.lower() for word in options.only or [""]]
        chosen = [c for c in everyone if any(word in c.label.lower() for word in words)]
        left_out |= {c.label: c.missing for c in chosen if c.missing}
        taking_part = [c for c in chosen if not c.missing]
        if taking_part:
            drives = _record(options, model, problem, driver=driver)
            tables.append((title, bench.measure(taking_part, model, problem, drives, progress=bar)))
    if not tables:
        names = ", ".join(c.label for c in [*BENCH_CONTENDERS, *BENCH_FULL_CONTENDERS])
        raise kl.ProblemError(f"--only {' '.join(options.only)}: none is left; names are {names}")
    imports = import_times()
    if options.picture:
        from kmpc_lab.bench.measure import write_bench_picture

        own = [row for _, table in tables[1:] for row in table[:1]]
        write_bench_picture(options.picture, [*tables[0][1], *own])
    told = {
        "machine": this_machine(),
        "tables": {title: [row.as_dict() for row in table] for title, table in tables},
        "left_out": left_out,
        "import_s": imports,
    }
    lines = [f"{title}\n{bench.format_measurements(table)}\n" for title, table in tables]
    lines += [f"left out: {name}: {reason}" for name, reason in left_out.items()]
    seconds = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in imports.items())
    return told, "\n".join([*lines, f"import: {seconds}"])


def _beside(options: argparse.Namespace) -> tuple[Any, str]:
    """Boards side by side, from files."""
    from kmpc_lab.bench.boards import format_boards, read_board

    boards = [read_board(file) for file in options.beside]
    return [board._asdict() for board in boards], format_boards(boards)


def _cold(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.cold import compare_cold, format_cold

    bars = [ProgressBar(name, quiet=options.json) for name in ("cold", "cold, lidar")]
    told = compare_cold(_drives(options), STEPS, OBSTACLES, _seed(options), *bars)
    return told, format_cold(told)


def _quality(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.drives import learned_model
    from kmpc_lab.bench.quality import as_dicts, compare, format_comparison
    from kmpc_lab.peers.paper import papers_problem

    model, problem = learned_model(), papers_problem()
    bar = ProgressBar("quality", quiet=options.json)
    drives = _record(options, model, problem, steps=QUALITY_STEPS)
    compared = compare(model, problem, drives, progress=bar)
    return as_dicts(compared), format_comparison(compared)


def _solvers(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab import bench
    from kmpc_lab.bench.drives import learned_model
    from kmpc_lab.peers.paper import papers_problem
    from kmpc_lab.studies.contenders import solver_contenders

    model, problem = learned_model(), papers_problem()
    drives = _record(options, model, problem)
    bar = ProgressBar("solvers", quiet=options.json)
    results = bench.measure(solver_contenders(), model, problem, drives, progress=bar)
    return [result.as_dict() for result in results], bench.format_measurements(results)


def _fit(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.fitting import fit_costs, format_fit_costs

    costs = fit_costs(progress=ProgressBar("fit", quiet=options.json))
    return [cost.as_dict() for cost in costs], format_fit_costs(costs)


def _loop(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.bench.drives import learned_model
    from kmpc_lab.bench.loop import run_loop
    from kmpc_lab.peers.paper import papers_problem

    result = run_loop(
        learned_model(),
        papers_problem(),
        options.loop,
        SECONDS if options.seconds is None else options.seconds,
        _seed(options),
        not options.no_load,
        options.budget,
        ProgressBar("real-time loop", quiet=options.json),
    )
    return result.as_dict(), str(result)


def _install_acados(options: argparse.Namespace) -> tuple[Any, str]:
    from kmpc_lab.peers.acados_wheel import install

    folder = install()
    return {"acados": str(folder)}, f"acados is in {folder}"


def _seed(options: argparse.Namespace) -> int:
    """First seed of the recorded drives."""
    from kmpc_lab.bench.measure import REPORTING_SEED, TUNING_SEED

    return TUNING_SEED if options.tuning else REPORTING_SEED


def _drives(options: argparse.Namespace) -> int:
    """How many drives are recorded."""
    return DRIVES if options.drives is None else int(options.drives)


def _record(
    options: argparse.Namespace,
    model: kl.KoopmanModel,
    problem: kl.NavigationProblem,
    steps: int = STEPS,
    seed: int | None = None,
    **driver: Any,
) -> Any:
    """Record as many drives as were asked for, from a first seed: that of the options if None."""
    from kmpc_lab.bench.drives import record

    first = _seed(options) if seed is None else seed
    return record(model, problem, _drives(options), steps, OBSTACLES, first, **driver)


RECORDED = ("--drives", "--tuning")
"""What a job reads that records drives."""
COMPARISON = Job(_compare, (*RECORDED, "--only", "--picture"))
"""What is done if no job is named."""
JOBS = {
    "--cold": Job(
        _cold,
        RECORDED,
        "time steps as a robot's caches find them: contenders in turns step by step, 10 ms of "
        "sleep before each; the exported controller, lidars, and peers",
    ),
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
    "--fit": Job(
        _fit, (), "measure time and memory of fitting 1,000,000 samples, and of a bare Gram product"
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
BESIDE = Job(_beside, (), "show boards side by side: files that kmpc bench --json wrote on each")
