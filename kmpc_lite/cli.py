"""kmpc: learn, drive, study, show.

Every command has --help with an example and --json; bad input ends in one line and exit status 2.
"""

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
from pathlib import Path
from typing import Any, NoReturn

# Worker processes load NumPy anew and inherit this: one BLAS thread each, more only get in each other's way.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import kmpc_lite as kl  # noqa: E402
from kmpc_lite.learn.formats import read_period  # noqa: E402
from kmpc_lite.sim import LearnedPlant, Outcome, Run, Scenario, drive  # noqa: E402
from kmpc_lite.sim.scenario import bundled  # noqa: E402

DICTIONARIES = {
    "unicycle": "the paper's [1, x, y, theta, cos, sin]",
    "trig": "[1, cos, sin]: the same wherever the robot is; the choice for a real log",
    "hermite1": "Hermite polynomials of degree 1 times [1, cos, sin]",
    "hermite2": "Hermite polynomials of degree 2 times [1, cos, sin]",
}
SHORTEST_PERIOD = 0.1


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
    parser = OneLineParser(prog="kmpc", description="Learn a robot from its log and drive it past obstacles to a pose.")
    parser.add_argument("--version", action="version", version=f"kmpc_lite {kl.__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")

    def command(name: str, run: Any, text: str, example: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text, epilog=f"example:\n{example}", formatter_class=raw)
        sub.set_defaults(run=run)
        sub.add_argument("--json", action="store_true", help="print one JSON object instead of text")
        return sub

    p = command(
        "demo",
        run_demo,
        "Learn from a drive, check the model, drive past four obstacles, and show it.",
        "  kmpc demo\n  kmpc demo --log run.csv        # your robot's log instead of a simulated one",
    )
    p.add_argument("--log", type=Path, help="log to learn from (t,x,y,theta,v,omega); a simulated drive is recorded where not given")
    p.add_argument("-o", "--output", type=Path, default=Path("out"), help="folder for log, model, run and report (default: out)")

    p = command(
        "fit",
        run_fit,
        "Learn a model from a log and check it on parts of the log that it has not seen.",
        "  kmpc fit run.csv -o robot.npz\n  kmpc fit run.csv -o robot.npz --dictionary trig --lags 0 1 2 --product",
    )
    p.add_argument("log", type=Path, nargs="+", help=".csv or .npz with t,x,y,theta,v,omega in s, m, rad, m/s, rad/s")
    p.add_argument("-o", "--output", type=Path, required=True, help="model file to write (.npz)")
    p.add_argument("--method", choices=("integral", "edmdc"), default="integral", help="integral (weak form, default) or the paper's edmdc")
    p.add_argument(
        "--dictionary", choices=tuple(DICTIONARIES), default="trig", help="; ".join(f"{k}: {v}" for k, v in DICTIONARIES.items())
    )
    p.add_argument("--lags", type=int, nargs="+", help="ages of the commands that act, in periods: motor lag and dead time (0 = no lag)")
    p.add_argument("--product", action="store_true", help="with --lags: let v*omega act too, the side slip of skid-steer robots")
    p.add_argument("--dt", type=float, help=f"the model's period [s] (default: {SHORTEST_PERIOD}, or the log's own if longer)")
    p.add_argument("--gap", type=float, help="a longer time between rows [s] ends an episode (default: 2.5 periods)")
    p.add_argument("--holdout", type=float, default=0.5, help="share of the episodes kept for the check (default: 0.5)")
    p.add_argument("--horizon", type=float, default=1.0, help="how far ahead the check looks [s] (default: 1)")
    p.add_argument("--seed", type=int, default=0, help="of the split (default: 0)")

    p = command(
        "simulate",
        run_simulate,
        "Drive a model through a scenario in simulation.",
        "  kmpc simulate --model robot.npz --scenario four_circles_1 --report drive.html\n"
        "  kmpc simulate --scenario mehrez          # the exact unicycle as the model",
    )
    p.add_argument("--model", type=Path, help="model that kmpc fit wrote (default: the nominal unicycle)")
    p.add_argument("--scenario", default="four_circles_1", help=f"a .toml file, or one of {', '.join(bundled())}")
    p.add_argument(
        "--plant",
        choices=("slip", "learned"),
        default="slip",
        help="slip: the scenario's slipping robot; learned: one that behaves as the model does, noise and lag included",
    )
    p.add_argument("--slip", type=float, help="mean slip ratio instead of the scenario's")
    p.add_argument("--margin", type=float, help="distance to keep beyond the radii [m] instead of the scenario's")
    p.add_argument("--seed", type=int, help="instead of the scenario's")
    p.add_argument("--horizon", type=int, default=20, help="stages that the controller looks ahead (default: 20)")
    p.add_argument("--iterations", type=int, default=1, help="SQP passes per step: 1 is real time, more converge (default: 1)")
    p.add_argument("-o", "--output", type=Path, help="run file to write (.npz)")
    p.add_argument("--report", type=Path, help="report to write (.html)")

    p = command(
        "report",
        run_report,
        "Show a run as one HTML page, or as PNG pictures.",
        "  kmpc report run.npz -o run.html\n  kmpc report run.npz --pictures figures",
    )
    p.add_argument("file", type=Path, help="run that kmpc simulate wrote (.npz)")
    p.add_argument("-o", "--output", type=Path, help="page to write (default: the run's name with .html)")
    p.add_argument("--model", type=Path, help="model of the run, to show how it was fitted")
    p.add_argument("--pictures", type=Path, help="folder to write PNG pictures to")

    p = command(
        "study",
        run_study,
        "Reproduce the paper's table 1 beside ours. Needs the extra peers (CasADi + IPOPT).",
        "  kmpc study table1\n  kmpc study table1 --trials 100 --json > table1.json",
    )
    p.add_argument("study", choices=("table1",), help="which study")
    p.add_argument("--trials", type=int, default=5, help="runs per cell (default: 5, as in the paper)")
    p.add_argument("--scenario", default="four_circles_1", help="map (default: four_circles_1); its slip and seed are replaced")
    p.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")

    p = command(
        "bench",
        run_bench,
        "Time a step on this machine, beside whichever peers are installed, on the same states in one run.",
        "  kmpc bench\n  kmpc bench --drives 40 --picture bench.png\n  kmpc bench --scaling\n  kmpc bench --loop 100 --seconds 600",
    )
    p.add_argument("--drives", type=int, default=20, help="recorded drives of 60 states (default: 20)")
    p.add_argument("--tuning", action="store_true", help="use the tuning seeds instead of the reporting ones")
    p.add_argument("--only", nargs="+", help="contenders whose names contain one of these words")
    p.add_argument("--picture", type=Path, help="picture of the distributions to write (.png)")
    p.add_argument("--scaling", action="store_true", help="how the time grows with horizon and obstacles, ours only")
    p.add_argument("--loop", type=float, metavar="HZ", help="run the control loop at this rate with the other cores busy")
    p.add_argument("--seconds", type=float, default=600.0, help="how long, with --loop (default: 600)")
    p.add_argument("--no-load", action="store_true", help="with --loop: leave the other cores alone")
    p.add_argument("--install-acados", action="store_true", help="fetch the acados peer (x86-64 Linux wheel, about 20 MB) and stop")
    return parser


def run_bench(options: argparse.Namespace) -> int:
    """Measure step times."""
    from kmpc_lite import bench
    from kmpc_lite.bench.measure import REPORTING_SEED, TUNING_SEED, format_scaling, import_times, learned_model, record, scaling

    if options.install_acados:
        from kmpc_lite.peers.acados import install

        folder = install()
        print(json.dumps({"acados": str(folder)}) if options.json else f"acados is in {folder}")
        return 0
    for name in ("drives", "seconds", "loop"):
        value = getattr(options, name)
        if value is not None and not value > 0:
            raise kl.ProblemError(f"--{name}: expected a number > 0, got {value}")
    seed = TUNING_SEED if options.tuning else REPORTING_SEED
    model, problem = learned_model(), kl.NavigationProblem()
    if options.loop:
        from kmpc_lite.bench.loop import run_loop

        result = run_loop(
            model, problem, options.loop, options.seconds, seed, not options.no_load, Progress("real-time loop", quiet=options.json)
        )
        print(json.dumps(result.as_dict()) if options.json else result)
        return 0
    bar = Progress("bench", quiet=options.json)
    if options.scaling:
        rows = scaling(model, seed, options.drives, progress=bar)
        print(json.dumps(rows) if options.json else format_scaling(rows))
        return 0
    everyone = bench.contenders()
    if options.only:
        everyone = [c for c in everyone if any(word.lower() in c.name.lower() for word in options.only)]
    taking_part, skipped = [c for c in everyone if not c.skipped], [c for c in everyone if c.skipped]
    if not taking_part:
        raise kl.ProblemError(f"--only {' '.join(options.only)}: nobody is left; names are {', '.join(c.name for c in bench.contenders())}")
    drives = record(model, problem, options.drives, steps=60, obstacles=4, seed=seed)
    results = bench.measure(taking_part, model, problem, drives, progress=bar)
    imports = import_times()
    if options.picture:
        from kmpc_lite.bench.picture import write_bench_picture

        write_bench_picture(options.picture, results)
    if options.json:
        print(
            json.dumps({"results": [r.as_dict() for r in results], "left_out": {c.name: c.skipped for c in skipped}, "import_s": imports})
        )
        return 0
    print(bench.format_measurements(results, skipped))
    print("import: " + ", ".join(f"{name} {seconds:.2f} s" for name, seconds in imports.items()))
    return 0


def run_fit(options: argparse.Namespace) -> int:
    """Fit a log, print the held-out errors, write the model."""
    _keep_inputs(options.output, *options.log)
    train, held = load_and_split(options.log, options.dt, options.gap, options.holdout, options.seed)
    dictionary = make_dictionary(options.dictionary, options.lags, options.product)
    model = kl.fit(train, dictionary, method=options.method)
    report = kl.evaluate(model, held, options.horizon)
    model = with_info(model, {"held_out": report.as_dict(), "log": [str(f) for f in options.log]})
    model.save(options.output)
    if options.json:
        print(json.dumps({"model": str(options.output), "train": repr(train), "held_out": report.as_dict(), **_fit_info(model)}))
        return 0
    print(f"train  {train}\nheld   {held}")
    info = model.info
    print(f"fit    {info['method']}, rank {info['rank']} of {info['features']}, condition {info['condition']:.3g}")
    print(f"{report}\nwrote  {options.output}")
    return 0


def run_simulate(options: argparse.Namespace) -> int:
    """Drive one scenario."""
    for output in (options.output, options.report):
        _keep_inputs(output, options.model, Path(options.scenario))
    scenario = Scenario.load(options.scenario)
    changes = {k: v for k, v in (("slip", options.slip), ("margin", options.margin), ("seed", options.seed)) if v is not None}
    scenario = Scenario.from_table(_overridden(scenario, changes), scenario.name, "command line")
    model = kl.KoopmanModel.load(options.model) if options.model else kl.nominal_unicycle(SHORTEST_PERIOD)
    run = simulate(model, scenario, options.plant, options.horizon, options.iterations)
    if options.output:
        run.save(options.output)
    if options.report:
        from kmpc_lite.report import write_report

        write_report(options.report, run, model=model, command=_command_line())
    print(json.dumps(run.summary()) if options.json else describe(run))
    for name in (options.output, options.report):
        if name and not options.json:
            print(f"wrote  {name}")
    return 0 if run.outcome is Outcome.REACHED else 1


def run_report(options: argparse.Namespace) -> int:
    """Make the page or the pictures of a run."""
    from kmpc_lite.report import write_pictures, write_report

    _keep_inputs(options.output, options.file, options.model)
    run = Run.load(options.file)
    model = kl.KoopmanModel.load(options.model) if options.model else None
    written = []
    if options.pictures:
        written += [str(f) for f in write_pictures(options.pictures, run)]
    if options.output or not options.pictures:
        page = options.output or options.file.with_suffix(".html")
        write_report(page, run, model=model, command=_command_line())
        written.append(str(page))
    print(json.dumps({"written": written}) if options.json else "\n".join(f"wrote  {name}" for name in written))
    return 0


def run_study(options: argparse.Namespace) -> int:
    """Run table 1 on all cores."""
    from kmpc_lite.sim.study import DT, TABLE_1_CONTROLLERS, format_table1, table1

    scenario = Scenario.load(options.scenario)
    for name in ("trials", "workers"):
        if getattr(options, name) < 1:
            raise kl.ProblemError(f"--{name}: expected a whole number >= 1, got {getattr(options, name)}")
    for row in TABLE_1_CONTROLLERS:
        # what is missing is told now, not after minutes of training
        row.build(kl.nominal_unicycle(DT), scenario)
    bar = Progress("table 1", quiet=options.json)
    with worker_pool(options.workers) as executor:
        cells = table1(scenario, executor, options.trials, progress=bar)
    print(json.dumps([c.as_dict() for c in cells]) if options.json else format_table1(cells))
    return 0


def run_demo(options: argparse.Namespace) -> int:
    """Do the main job from end to end, through files, as a user would."""
    from kmpc_lite.report import write_report

    say = (lambda text: None) if options.json else print
    folder: Path = options.output
    scenario = Scenario.load("four_circles_1")
    log = options.log or folder / "drive.csv"
    if options.log is None:
        folder.mkdir(parents=True, exist_ok=True)
        say(f"1  recording 200 s of driving on a floor that slips (mean slip {scenario.slip:g}): {log}")
        plant = kl.DifferentialDrive(scenario.slip, seed=1)
        kl.generate_dataset(plant, episodes=20, steps=100, dt=SHORTEST_PERIOD, seed=1, u_max=(0.6, 0.8)).save(log)
    else:
        say(f"1  reading {log}")
    train, held = load_and_split([log], None, None, 0.5, 0)
    folder.mkdir(parents=True, exist_ok=True)
    model = kl.fit(train, make_dictionary("trig", None, False))
    report = kl.evaluate(model, held, 1.0)
    model = with_info(model, {"held_out": report.as_dict(), "log": [str(log)]})
    model.save(folder / "robot.npz")
    say(f"2  learned {folder / 'robot.npz'} from {train}")
    say("   " + str(report).replace("\n", "\n   "))
    run = simulate(model, scenario, "learned" if options.log else "slip", 20, 1)
    run.save(folder / "run.npz")
    say(f"3  drove {scenario.name}: {describe(run)}")
    page = folder / "report.html"
    write_report(page, run, model=model, fit_report=report, command=_command_line())
    if options.json:
        print(json.dumps({"report": str(page), "held_out": report.as_dict(), **run.summary()}))
    else:
        print(f"4  open {page.resolve()}")
    return 0 if run.outcome is Outcome.REACHED else 1


def load_and_split(logs: list[Path], dt: float | None, gap: float | None, holdout: float, seed: int) -> tuple[kl.Dataset, kl.Dataset]:
    """Read logs at one period and part them, by episodes, into what is learned from and what is kept for the check."""
    if not 0.0 < holdout < 1.0:
        raise kl.DataError(f"--holdout: expected a share between 0 and 1, got {holdout}")
    if seed < 0:
        raise kl.DataError(f"--seed: expected a whole number >= 0, got {seed}")
    if dt is None:
        dt = max(SHORTEST_PERIOD, read_period(logs[0]))
    data = kl.Dataset([e for log in logs for e in kl.Dataset.load(log, dt=dt, gap=gap).episodes])
    if len(data) < 10:
        data = data.windows(max(5.0, 50 * dt))
    return data.split(1.0 - holdout, seed=seed)


def _keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read."""
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise kl.DataError(f"{output}: would be written over, but is read too; choose another name for what is written")


def make_dictionary(name: str, lags: list[int] | None, product: bool) -> kl.Dictionary:
    """Dictionary by its name on the command line."""
    base: kl.Dictionary
    match name:
        case "unicycle":
            base = kl.UnicycleDictionary()
        case "trig":
            base = kl.HermiteTrigDictionary(order=0)
        case _:
            base = kl.HermiteTrigDictionary(order=int(name.removeprefix("hermite")))
    if product and not lags:
        raise kl.ModelError("--product goes with --lags, for example --lags 0 --product")
    return kl.InputHistoryDictionary(base, tuple(lags), product) if lags else base


def simulate(model: kl.KoopmanModel, scenario: Scenario, plant: str, horizon: int, iterations: int) -> Run:
    """Drive one scenario with our controller at the model's period."""
    problem = scenario.problem(kl.NavigationProblem(horizon=horizon, dt=model.dt))
    controller = kl.Controller(model, problem, sqp_iterations=iterations)
    robot = LearnedPlant(model, scenario.seed) if plant == "learned" else None
    u_min, u_max, _, _ = problem.bounds
    info = {"plant": plant, "model": model.info.get("method", ""), "u_min": u_min.tolist(), "u_max": u_max.tolist()}
    return drive(controller, scenario, robot, dt=model.dt, info=info)


def describe(run: Run) -> str:
    """Put a run into a few lines."""
    s = run.summary()
    clearance = "no obstacles" if s["clearance_m"] is None else f"smallest clearance {100 * s['clearance_m']:.1f} cm"
    times, statuses = s["step_ms"], ", ".join(f"{n} {name}" for name, n in s["statuses"].items())
    return (
        f"{run.outcome.value} after {run.duration:.2f} s, {clearance}, "
        f"{100 * run.position_error:.1f} cm and {run.heading_error:.2f} rad from the goal\n"
        f"   step p50 {times['p50']:.2f} ms, p99 {times['p99']:.2f} ms, max {times['max']:.2f} ms; {statuses}"
    )


def with_info(model: kl.KoopmanModel, more: dict[str, Any]) -> kl.KoopmanModel:
    """Return the model with more in its info."""
    from dataclasses import replace

    return replace(model, info={**model.info, **more})


def _fit_info(model: kl.KoopmanModel) -> dict[str, Any]:
    return {key: model.info[key] for key in ("method", "samples", "rank", "features", "condition")}


def _overridden(scenario: Scenario, changes: dict[str, Any]) -> dict[str, Any]:
    """Scenario as a table with the command line's values, to be checked as a file would be."""
    import tomllib

    table = tomllib.loads(scenario.to_toml())
    for key, value in changes.items():
        table["plant" if key == "slip" else "run"][key] = value
    return table


def _command_line() -> str:
    return "kmpc " + " ".join(sys.argv[1:])


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor]:
    """Fresh processes, so that they load NumPy with one thread each; an interrupt ends them at once."""
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    # a terminal sends Ctrl-C to the workers too: they inherit that it is blocked, and leave it to this process
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


if __name__ == "__main__":
    sys.exit(main())
