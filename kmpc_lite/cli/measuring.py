"""What the kmpc commands bench and study do, with their progress bar and their workers."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

import kmpc_lite as kl
from kmpc_lite.sim import Scenario


def run_bench(options: argparse.Namespace) -> int:
    """Measure step times."""
    from kmpc_lite import bench
    from kmpc_lite.bench.measure import (
        REPORTING_SEED,
        TUNING_SEED,
        format_scaling,
        import_times,
        learned_model,
        record,
        scaling,
    )

    if options.install_acados:
        from kmpc_lite.peers.acados import install

        folder = install()
        print(json.dumps({"acados": str(folder)}) if options.json else f"acados is in {folder}")
        return 0
    if options.fit:
        from kmpc_lite.bench.fitting import fit_costs, format_fit_costs

        costs = fit_costs(progress=Progress("fit", quiet=options.json))
        print(json.dumps([c.as_dict() for c in costs]) if options.json else format_fit_costs(costs))
        return 0
    for name in ("drives", "seconds", "loop", "budget"):
        value = getattr(options, name)
        if value is not None and not value > 0:
            raise kl.ProblemError(f"--{name}: expected a number > 0, got {value}")
    seed = TUNING_SEED if options.tuning else REPORTING_SEED
    model, problem = learned_model(), kl.NavigationProblem()
    if options.loop:
        from kmpc_lite.bench.loop import run_loop

        result = run_loop(
            model,
            problem,
            options.loop,
            options.seconds,
            seed,
            not options.no_load,
            options.budget,
            Progress("real-time loop", quiet=options.json),
        )
        print(json.dumps(result.as_dict()) if options.json else result)
        return 0
    bar = Progress("bench", quiet=options.json)
    if options.scaling:
        rows = scaling(model, seed, options.drives, progress=bar)
        print(json.dumps(rows) if options.json else format_scaling(rows))
        return 0
    if options.quality:
        from kmpc_lite.bench.quality import as_dicts, compare, format_comparison

        compared = compare(
            model,
            problem,
            record(model, problem, options.drives, steps=50, obstacles=4, seed=seed),
            progress=bar,
        )
        print(json.dumps(as_dicts(compared)) if options.json else format_comparison(compared))
        return 0
    if options.settings:
        from kmpc_lite.bench.settings import format_settings, settings_study

        drives = record(model, problem, options.drives, steps=60, obstacles=4, seed=TUNING_SEED)
        rows = settings_study(model, problem, drives, progress=bar)
        print(json.dumps({"settings": rows}) if options.json else format_settings(rows))
        return 0
    if options.solvers:
        from kmpc_lite.bench.solvers import solver_contenders

        drives = record(model, problem, options.drives, steps=60, obstacles=4, seed=seed)
        results = bench.measure(solver_contenders(), model, problem, drives, progress=bar)
        if options.json:
            print(json.dumps([result.as_dict() for result in results]))
        else:
            print(bench.format_measurements(results))
        return 0
    tables = []
    left_out: dict[str, str] = {}
    for title, everyone, driver in (
        (
            "the paper's problem, on the states of a plain controller's drives",
            bench.contenders(),
            bench.plain,
        ),
        (
            "guidance and margins on, on the states of its own drives; IPOPT solves the paper's problem there",
            bench.full_contenders(),
            bench.full,
        ),
    ):
        chosen = [
            c
            for c in everyone
            if not options.only or any(word.lower() in c.name.lower() for word in options.only)
        ]
        left_out |= {c.name: c.skipped for c in chosen if c.skipped}
        taking_part = [c for c in chosen if not c.skipped]
        if taking_part:
            drives = record(
                model, problem, options.drives, steps=60, obstacles=4, seed=seed, build=driver
            )
            tables.append((title, bench.measure(taking_part, model, problem, drives, progress=bar)))
    if not tables:
        names = ", ".join(c.name for c in [*bench.contenders(), *bench.full_contenders()])
        raise kl.ProblemError(f"--only {' '.join(options.only)}: nobody is left; names are {names}")
    imports = import_times()
    if options.picture:
        from kmpc_lite.bench.picture import write_bench_picture

        write_bench_picture(
            options.picture, [*tables[0][1], *(r for _, table in tables[1:] for r in table[:1])]
        )
    if options.json:
        print(
            json.dumps(
                {
                    "tables": {t: [r.as_dict() for r in table] for t, table in tables},
                    "left_out": left_out,
                    "import_s": imports,
                }
            )
        )
        return 0
    for title, table in tables:
        print(f"{title}\n{bench.format_measurements(table)}\n")
    print("\n".join(f"left out: {name}: {reason}" for name, reason in left_out.items()))
    print("import: " + ", ".join(f"{name} {seconds:.2f} s" for name, seconds in imports.items()))
    return 0


def run_study(options: argparse.Namespace) -> int:
    """Run a study on all cores."""
    for name in ("trials", "maps", "workers"):
        if getattr(options, name) < 1:
            raise kl.ProblemError(
                f"--{name}: expected a whole number >= 1, got {getattr(options, name)}"
            )
    return {"table1": run_table1, "faults": run_faults}.get(options.study, run_maps)(options)


def run_faults(options: argparse.Namespace) -> int:
    """Drive with forced failures; status 1 where something was seen that must not be."""
    from kmpc_lite.studies.faults import SLIPS, as_dicts, faults_study, format_faults
    from kmpc_lite.studies.table1 import REPORTING_SEED

    bar = Progress(options.study, quiet=options.json)
    with worker_pool(options.workers) as executor:
        first_seed = 0 if options.tuning else REPORTING_SEED
        rows = faults_study(
            executor,
            options.maps,
            tuple(options.slips or SLIPS),
            first_seed=first_seed,
            progress=bar,
        )
    print(json.dumps(as_dicts(rows)) if options.json else format_faults(rows))
    return int(any(row.bad for row in rows))


def run_maps(options: argparse.Namespace) -> int:
    """Drive random maps, under the conditions of one of the studies over them."""
    from kmpc_lite.studies.catalogue import STUDIES, choose
    from kmpc_lite.studies.random_maps import maps_study
    from kmpc_lite.studies.table1 import DT, REPORTING_SEED
    from kmpc_lite.studies.tables import format_maps, summarise, time_ratio

    study = STUDIES[options.study]
    specs = choose(study, options.controllers)
    for spec in specs:
        spec.build(
            kl.nominal_unicycle(DT), Scenario.load("mehrez")
        )  # what is missing is told now, not after minutes of training
    bar = Progress(options.study, quiet=options.json)
    with worker_pool(options.workers) as executor:
        records = maps_study(
            specs,
            executor,
            families=options.families,
            slips=tuple(options.slips or study.slips),
            maps=options.maps,
            first_seed=0 if options.tuning else REPORTING_SEED,
            records=options.records,
            failures=options.failures,
            trained_at=study.trained_at if options.trained_at is None else options.trained_at,
            conditions=study.conditions,
            progress=bar,
        )
    rows = summarise(records)
    if options.json:
        print(json.dumps([row.as_dict() for row in rows]))
        return 0
    print(format_maps(rows))
    ours, reference = (
        specs[-1].label,
        next((c.label for c in specs if c.label == "K-NMPC, IPOPT"), None),
    )
    if reference and reference != ours:
        both, ratio = time_ratio(records, ours, reference)
        print(
            f"time to the pose, {ours} to {reference}, on the {both} drives where both arrive: {'-' if ratio is None else f'{ratio:.3f}'}"
        )
    return 0


def run_table1(options: argparse.Namespace) -> int:
    """Run the paper's table 1."""
    from kmpc_lite.studies.table1 import DT, TABLE_1_CONTROLLERS, format_table1, table1

    scenario = Scenario.load(options.scenario)
    for row in TABLE_1_CONTROLLERS:
        # what is missing is told now, not after minutes of training
        row.build(kl.nominal_unicycle(DT), scenario)
    bar = Progress("table 1", quiet=options.json)
    with worker_pool(options.workers) as executor:
        cells = table1(scenario, executor, options.trials, progress=bar)
    print(json.dumps([c.as_dict() for c in cells]) if options.json else format_table1(cells))
    return 0


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor]:
    """Fresh processes, so that they load NumPy with one thread each; an interrupt ends them at once."""
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    # a terminal sends Ctrl-C to the workers too: they inherit that it is blocked, and leave it to
    # this process
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        for _ in range(workers):
            pool.submit(os.getpid)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
    try:
        yield pool
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


class Progress:
    """A bar on standard error, on a terminal only."""

    def __init__(self, label: str, quiet: bool = False) -> None:
        self.label, self.begin = label, time.monotonic()
        self.shown = sys.stderr.isatty() and not quiet

    def __call__(self, done: int, total: int) -> None:
        """Draw `done` of `total`."""
        if not self.shown:
            return
        elapsed = time.monotonic() - self.begin
        left = elapsed / done * (total - done) if done else 0.0
        filled = 30 * done // total
        end = "\n" if done == total else ""
        print(
            f"\r{self.label} [{'#' * filled}{'.' * (30 - filled)}] {done}/{total}  {left:4.0f} s left ",
            end=end,
            file=sys.stderr,
            flush=True,
        )
