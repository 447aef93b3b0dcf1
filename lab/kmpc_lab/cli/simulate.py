"""`kmpc simulate`: drive a model through a scenario in simulation."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import kmpc_lite as kl
from firmware_bridge.cli.options import add_live_options, live_address
from kmpc_lab.cli.scenario import DEFAULT, add_scenario_options, read_scenario
from kmpc_lite.cli.command import Command, command_line, keep_inputs, need, positive
from kmpc_lite.defaults import SHORTEST_PERIOD

if TYPE_CHECKING:
    from firmware_bridge.live.address import LiveAddress
    from kmpc_lab.recording.simulated import SimulationRecorder
    from kmpc_lab.sim.closed_loop import Run
    from kmpc_lite.scenario.files import Scenario

BEYOND = 1.05  # a speed may exceed what a log shows by this factor
TOLD, FAR = 0.01, 1.0
"""A clearance that is more than asked for by so much is explained, if it is not beyond [m]."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_scenario_options(parser)
    add = parser.add_argument_group("model, robot and controller").add_argument
    text = "model that kmpc fit wrote (default: the nominal unicycle)"
    add("--model", type=Path, metavar="FILE", help=text)
    text = (
        "slip: the scenario's slipping robot (default without a model, or with --slip)\n"
        "learned: the robot of the model, noise and lag included (default with a model)"
    )
    add("--plant", choices=("slip", "learned"), help=text)
    text = "stages that the controller looks ahead (default: 20)"
    add("--horizon", type=int, default=20, metavar="N", help=text)
    text = "fastest speed, ahead and back [m/s] (default: 0.6, or what the model's log shows)"
    add("--max-speed", type=positive, metavar="V", help=text)
    add("--no-adaptation", action="store_true", help="do not correct the model while driving")
    text = (
        "SQP passes per step: 1 is real time, more converge (default: 1, or more where the "
        "robot turns far in a period)"
    )
    add("--iterations", type=int, metavar="N", help=text)
    text = (
        "give the controller the scans of a lidar with this reach [m] instead of the "
        "obstacles; [lidar] of a scenario does the same"
    )
    add("--lidar", type=positive, metavar="M", help=text)
    add = parser.add_argument_group("what to write").add_argument
    add("--report", type=Path, metavar="FILE", help="report to write (.html)")
    text = "folder for the drive, for kmpc report, kmpc fit and Foxglove"
    add("--record", type=Path, metavar="DIR", help=text)
    add_live_options(parser)


def run(options: argparse.Namespace) -> int:
    """Drive one scenario; status 1 where the robot does not arrive."""
    if options.report:
        need("--report", "matplotlib")
    from kmpc_lab.sim.closed_loop import Outcome

    named = options.map or options.scenario or DEFAULT
    keep_inputs(options.report, options.model, Path(named))
    if options.plant == "learned" and options.slip is not None:
        raise kl.ProblemError("--slip goes with --plant slip: a learned robot slips as its log did")
    scenario = read_scenario(options)
    if options.model:
        model = kl.KoopmanModel.load(options.model)
        scenario = scenario.of_robot(model.info)
    elif isinstance(scenario.wheels, kl.Omni):
        model = kl.nominal_omni(SHORTEST_PERIOD)
    else:
        model = kl.nominal_unicycle(SHORTEST_PERIOD)
    if options.plant is None:
        options.plant = "learned" if options.model and options.slip is None else "slip"
    adaptation = False if options.no_adaptation else None
    page = live_address(options)
    base = kl.NavigationProblem(horizon=options.horizon, dt=model.dt)
    base = _limited(base, options.max_speed, model.info.get("driven"), str(options.model))
    drive, recorder = simulate(
        model, scenario, options.plant, base, options.iterations, adaptation, page
    )
    drive.info["command"] = command_line()
    recorded = recorder.write(options.record, drive) if options.record else None
    if options.report:
        from kmpc_lab.report.html import write_report

        drive = recorder.with_details(drive)
        write_report(options.report, drive, model=model, command=command_line())
    if options.json:
        print(json.dumps(drive.summary()))
    else:
        print(describe(drive) + hint(drive, model) + held_apart(options, drive))
        for name in filter(None, (options.report, recorded)):
            print(f"wrote  {name}")
    return 0 if drive.outcome is Outcome.REACHED else 1


def simulate(
    model: kl.KoopmanModel,
    scenario: Scenario,
    plant: str,
    base: kl.NavigationProblem,
    iterations: int | None,
    adaptation: bool | None = None,
    page: LiveAddress | None = None,
) -> tuple[Run, SimulationRecorder]:
    """Drive one scenario with our controller; watched by a recorder.

    `base` says what the scenario does not: period, horizon, speeds. With `page` it drives in real
    time, for viewers.
    """
    from kmpc_lab.recording.simulated import SimulationRecorder
    from kmpc_lab.sim.closed_loop import drive
    from kmpc_lab.sim.plants.plant import LearnedPlant

    problem = scenario.problem(base)
    controller = kl.Controller(
        model,
        problem,
        sqp_iterations=iterations,
        adaptation=adaptation,
        pose_age=scenario.pose_age,
        options=scenario.options,
    )
    robot = LearnedPlant(model, scenario.seed) if plant == "learned" else None
    u_min, u_max, _, _ = problem.bounds
    info: dict[str, Any] = {
        "plant": plant,
        "model": model.info.get("method", ""),
        "u_min": u_min[[0, -1]].tolist(),
        "u_max": u_max[[0, -1]].tolist(),
    }
    recorder = SimulationRecorder(controller)
    lidar = None
    if scenario.lidar is not None:
        from kmpc_lab.sim.lidar import Lidar

        lidar = Lidar(scenario, scenario.lidar)
    if page is None:
        run = drive(controller, scenario, robot, model.dt, info=info, watch=recorder, lidar=lidar)
        return run, recorder
    from kmpc_lab.recording.simulated import WatchedController, shown

    watched = WatchedController(controller)
    with shown(watched, scenario, page) as tell:
        run = drive(watched, scenario, robot, model.dt, info=info, watch=recorder, lidar=lidar)
        tell(run.info.get("ended") or f"{run.outcome.value} after {run.duration:.2f} s")
    return run, recorder


def _limited(
    base: kl.NavigationProblem,
    max_speed: float | None,
    driven: Mapping[str, float] | None,
    name: str,
) -> kl.NavigationProblem:
    """Let a problem's robot drive as fast as that, ahead and back [m/s], or as its log shows.

    Raises ProblemError for a speed that the log of the model does not show.
    """
    if max_speed is None and driven is None:
        return base
    ahead = back = max_speed or float(base.u_max[0])
    turn = float(base.u_max[1])
    if driven is not None:
        shown = max(driven["forward"], driven["reverse"])
        if max_speed is not None and max_speed > BEYOND * shown:
            raise kl.ProblemError(
                f"--max-speed {max_speed:g}: the log of {name} shows {shown:.2g} m/s at the most, "
                "and nobody knows how its robot drives faster"
            )
        ahead, back = driven["forward"], driven["reverse"]
        if max_speed is not None:
            ahead, back = min(ahead, max_speed), min(back, max_speed)
        turn = driven["turn"] or turn
    high, low = (ahead or back, turn), (-back, -turn)
    return replace(base, u_min=low, u_max=high, deceleration=None, slack_weights=None)


def describe(run: Run) -> str:
    """Put a run into a few lines."""
    told = run.summary()
    clearance = (
        "no obstacles"
        if told["clearance_m"] is None
        else f"smallest clearance {100 * told['clearance_m']:.1f} cm"
    )
    times = told["step_ms"]
    statuses = ", ".join(f"{count} {name}" for name, count in told["statuses"].items())
    route = run.info.get("route")
    why = f"\nwhy    {run.info['ended']}" if run.info.get("ended") else ""
    goals = "" if route is None else f" {route['held']} of {route['of']} goals"
    return (
        f"{run.outcome.value}{goals} after {run.duration:.2f} s, {clearance}, "
        f"{100 * run.position_error:.1f} cm and {run.heading_error:.2f} rad from the goal\n"
        f"   step p50 {times['p50']:.2f} ms, p99 {times['p99']:.2f} ms, max {times['max']:.2f} ms; "
        f"{statuses}{why}"
    )


def held_apart(options: argparse.Namespace, drive: Run) -> str:
    """Tell what else keeps the distance, if one was asked for that is not what came of it."""
    asked = options.margin
    if asked is None or not asked + TOLD < drive.clearance < FAR:
        return ""
    return (
        f"\nclearance  {100 * asked:.1f} cm requested, {100 * drive.clearance:.1f} cm kept: paths "
        "keep more where they can (guidance.wide_clearance,\n"
        "   in radii), plans what the model does not know (margins.headway): --set lessens both"
    )


def hint(run: Run, model: kl.KoopmanModel) -> str:
    """Tell why a drive may have failed where model and robot disagree on lag; or nothing."""
    from kmpc_lab.sim.closed_loop import Outcome

    lags = bool(run.scenario.lag or run.scenario.dead_time)
    if run.outcome is Outcome.REACHED or run.info["plant"] != "slip" or lags == bool(model.history):
        return ""
    if lags:
        return (
            "\nhint   this robot obeys late, its model knows no lag: "
            "learn it from a log of the robot with kmpc fit"
        )
    return (
        f"\nhint   the model looks back on {model.history} past commands, this robot obeys at "
        "once: --plant learned drives one that lags as the log did; or give [plant] of the "
        "scenario its lag and dead_time"
    )


COMMAND = Command(
    text="Drive a model through a scenario in simulation.",
    examples=(
        "kmpc simulate map.toml --model robot.npz --report drive.html",
        "kmpc simulate mehrez                   # the exact unicycle as the model",
        "kmpc simulate --goal 1.5 1 0 --obstacle 0.7 0.5 0.2 --obstacle 1 -1 0.2 0 0.2",
        "kmpc simulate --goal 1 0 90deg --goal 1 1 180deg --goal 0 0 0   # a route",
        "kmpc simulate room_grid --lidar 2 --report drive.html  # by what a lidar of 2 m sees",
        "kmpc simulate walls_door --live        # in real time, in a browser",
    ),
    add_options=add_options,
    run=run,
)
