"""What the kmpc commands fit, simulate, report and demo do."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import kmpc_lite as kl
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.margins import Margins
from kmpc_lite.learn.formats.tables import read_period
from kmpc_lite.sim import LearnedPlant, Outcome, Run, Scenario, drive

SHORTEST_PERIOD = 0.1
"""Period of models [s] where neither the user nor a slower log says otherwise: the paper's."""


def run_fit(options: argparse.Namespace) -> int:
    """Fit a log, print the held-out errors, write the model."""
    _keep_inputs(options.output, *options.log)
    train, held = load_and_split(
        options.log, options.dt, options.gap, options.holdout, options.seed
    )
    dictionary = make_dictionary(options.dictionary, options.lags, options.product)
    model = kl.fit(train, dictionary, method=options.method)
    report = kl.evaluate(model, held, options.horizon)
    model, calibration = calibrated(model, held)
    model = with_info(model, {"held_out": report.as_dict(), "log": [str(f) for f in options.log]})
    model.save(options.output)
    if options.json:
        told = {
            "model": str(options.output),
            "train": repr(train),
            "held_out": report.as_dict(),
            "margins": calibration.removeprefix("margins: "),
        }
        print(json.dumps({**told, **_fit_info(model)}))
        return 0
    print(f"train  {train}\nheld   {held}")
    info = model.info
    print(
        f"fit    {info['method']}, rank {info['rank']} of {info['features']}, condition {info['condition']:.3g}"
    )
    print(f"{report}\n{calibration}\nwrote  {options.output}")
    return 0


def run_simulate(options: argparse.Namespace) -> int:
    """Drive one scenario."""
    for output in (options.output, options.report):
        _keep_inputs(output, options.model, Path(options.scenario))
    if options.plant == "learned" and options.slip is not None:
        raise kl.ProblemError("--slip goes with --plant slip: a learned robot slips as its log did")
    scenario = Scenario.load(options.scenario)
    changes = {
        k: v
        for k, v in (
            ("slip", options.slip),
            ("margin", options.margin),
            ("seed", options.seed),
            ("timeout", options.timeout),
        )
        if v is not None
    }
    scenario = Scenario.from_table(_overridden(scenario, changes), scenario.name, "command line")
    model = (
        kl.KoopmanModel.load(options.model)
        if options.model
        else kl.nominal_unicycle(SHORTEST_PERIOD)
    )
    adaptation = False if options.no_adaptation else None
    run = simulate(model, scenario, options.plant, options.horizon, options.iterations, adaptation)
    run.info["command"] = _command_line()
    if options.output:
        run.save(options.output)
    if options.report:
        from kmpc_lite.report import write_report

        write_report(options.report, run, model=model, command=_command_line())
    print(json.dumps(run.summary()) if options.json else describe(run) + hint(run, model))
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
    print(
        json.dumps({"written": written})
        if options.json
        else "\n".join(f"wrote  {name}" for name in written)
    )
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
        say(
            f"1  recording 200 s of driving on a floor that slips (mean slip {scenario.slip:g}): {log}"
        )
        plant = kl.DifferentialDrive(scenario.slip, seed=1)
        kl.generate_dataset(
            plant, episodes=20, steps=100, dt=SHORTEST_PERIOD, seed=1, u_max=(0.6, 0.8)
        ).save(log)
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


def load_and_split(
    logs: list[Path], dt: float | None, gap: float | None, holdout: float, seed: int
) -> tuple[kl.Dataset, kl.Dataset]:
    """Read logs at one period and part them, by episodes, into what is learned from and what is kept for the check."""
    if not 0.0 < holdout < 1.0:
        raise kl.DataError(f"--holdout: expected a share between 0 and 1, got {holdout}")
    if seed < 0:
        raise kl.DataError(f"--seed: expected a whole number >= 0, got {seed}")
    if (
        twice := next(
            (
                log
                for k, log in enumerate(logs)
                if log.resolve() in [other.resolve() for other in logs[:k]]
            ),
            None,
        )
    ) is not None:
        raise kl.DataError(
            f"{twice}: given twice: what is learned from would be checked against itself"
        )
    if dt is None:
        dt = max(SHORTEST_PERIOD, read_period(logs[0]))
    data = kl.Dataset([e for log in logs for e in kl.Dataset.load(log, dt=dt, gap=gap).episodes])
    if len(data) < 10:
        data = data.windows(max(5.0, 50 * dt))
    if len(data) < 2:
        where = ", ".join(map(str, logs))
        raise kl.DataError(
            f"{where}: {data.steps * dt:g} s of driving are too few to learn from a part and check the other"
        )
    return data.split(1.0 - holdout, seed=seed)


def calibrated(model: kl.KoopmanModel, held: kl.Dataset) -> tuple[kl.KoopmanModel, str]:
    """Model with its margins calibrated on held-out drives, where those suffice; and what became of it in a line."""
    try:
        model = kl.with_quantiles(model, held)
        how = f"calibrated on {model.info['noise_quantiles']['windows']} held-out windows"
    except kl.DataError as error:
        how = f"not calibrated, cautious ones will be used ({error})"
    problem = kl.NavigationProblem(dt=model.dt)
    widest = Margins(model, problem).tightening.widest(DriftState())
    return (
        model,
        f"margins: {how}; up to {100 * widest:.0f} cm from obstacles at {problem.bounds[1][0]:g} m/s",
    )


def _keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read."""
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise kl.DataError(
                f"{output}: would be written over, but is read too; choose another name for what is written"
            )


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


def simulate(
    model: kl.KoopmanModel,
    scenario: Scenario,
    plant: str,
    horizon: int,
    iterations: int,
    adaptation: bool | None = None,
) -> Run:
    """Drive one scenario with our controller at the model's period."""
    problem = scenario.problem(kl.NavigationProblem(horizon=horizon, dt=model.dt))
    controller = kl.Controller(
        model, problem, sqp_iterations=iterations, adaptation=adaptation, pose_age=scenario.pose_age
    )
    robot = LearnedPlant(model, scenario.seed) if plant == "learned" else None
    u_min, u_max, _, _ = problem.bounds
    info = {
        "plant": plant,
        "model": model.info.get("method", ""),
        "u_min": u_min.tolist(),
        "u_max": u_max.tolist(),
    }
    return drive(controller, scenario, robot, dt=model.dt, info=info)


def describe(run: Run) -> str:
    """Put a run into a few lines."""
    s = run.summary()
    clearance = (
        "no obstacles"
        if s["clearance_m"] is None
        else f"smallest clearance {100 * s['clearance_m']:.1f} cm"
    )
    times, statuses = s["step_ms"], ", ".join(f"{n} {name}" for name, n in s["statuses"].items())
    return (
        f"{run.outcome.value} after {run.duration:.2f} s, {clearance}, "
        f"{100 * run.position_error:.1f} cm and {run.heading_error:.2f} rad from the goal\n"
        f"   step p50 {times['p50']:.2f} ms, p99 {times['p99']:.2f} ms, max {times['max']:.2f} ms; {statuses}"
    )


def hint(run: Run, model: kl.KoopmanModel) -> str:
    """Tell why a drive may have failed, where model and robot disagree on lag; a line or nothing."""
    lags = bool(run.scenario.lag or run.scenario.dead_time)
    if run.outcome is Outcome.REACHED or run.info["plant"] != "slip" or lags == bool(model.history):
        return ""
    if lags:
        return "\nhint   this robot obeys late, its model knows no lag: learn it from a log of the robot with kmpc fit --lags 0 1 2"
    return (
        f"\nhint   the model looks back on {model.history} past commands, this robot obeys at once: --plant learned drives one that lags "
        "as the log did; or give [plant] of the scenario its lag and dead_time"
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
