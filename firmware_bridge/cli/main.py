"""kmpc-bridge: check a robot, drive it, record it, play it back, stop it, or pretend to be one.

Every command has --help with an example and --json; bad input ends in one line and exit status 2.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TextIO

# one BLAS thread: more would only get in the gate's way; NumPy reads this when it is loaded
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from firmware_bridge.cli.arguments import build_parser  # noqa: E402
from firmware_bridge.messages import BridgeError, ConfigError, LinkError  # noqa: E402
from firmware_bridge.robot_file import NOMINAL_LATENCY, Robot, load_robot  # noqa: E402
from firmware_bridge.safety.estop import WORDS, ask, default_socket, latch_file, set_latch  # noqa: E402

INTERRUPTED = 130
UNKNOWN = (math.nan, math.nan)
"""The command of a period in which nobody knows what was on the wire."""
FENCE_ROOM = 0.25
"""Without a geofence of its own a robot may leave the scenario's area by so much [m]."""
LOOK_AHEAD = 2.0
"""Time that the controller plans ahead, however short its period [s]."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status: 0 done, 1 not done, 2 bad input, 130 interrupted."""
    options = build_parser(COMMANDS).parse_args(arguments)
    try:
        status: int = options.run(options)
        return status
    except BridgeError as error:
        return _complain(str(error))
    except OSError as error:
        return _complain(f"{error.filename or ''}: {error.strerror or error}")
    except KeyboardInterrupt:
        _complain("stopped")
        return INTERRUPTED


def _complain(text: str) -> int:
    sys.stderr.write(f"kmpc-bridge: {text}\n")
    return 2


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def load(options: argparse.Namespace) -> Robot:
    """Read the robot file under the options of a command line."""
    given = vars(options)
    overrides: dict[str, dict[str, Any]] = {
        "link": {
            "url": given.get("link"),
            "driver": given.get("driver"),
            "timeout": given.get("timeout"),
            "pose": given.get("pose"),
        },
        "board": {"arm": True if given.get("arm") else None},
        "limits": {
            "v_max": given.get("v_max"),
            "v_reverse": given.get("v_max"),
            "omega_max": given.get("omega_max"),
        },
        "safety": {"geofence": given.get("geofence"), "socket": given.get("socket")},
        "control": {
            name: given.get(name)
            for name in ("period", "command_period", "latency", "model", "scenario")
        },
    }
    for item in given.get("set", []):
        name, equals, value = item.partition("=")
        section, dot, key = name.strip().partition(".")
        try:
            if not (equals and dot):
                raise ValueError
            overrides.setdefault(section, {})[key] = tomllib.loads(f"value = {value}")["value"]
        except ValueError:
            raise ConfigError(
                f'--set {item}: expected SECTION.KEY=VALUE with a TOML value (text in quotes: board.role="gcs")'
            ) from None
    robot = load_robot(given.get("robot"), overrides)
    if given.get("arm") and not robot.is_autopilot:
        raise ConfigError(
            f"--arm: only an autopilot is armed; {robot.link.driver} drives as soon as the bridge runs"
        )
    return robot


def _check(options: argparse.Namespace) -> int:
    from firmware_bridge.cli.check import check

    findings = check(load(options), options.seconds)
    if options.json:
        _say(
            json.dumps(
                {
                    "ok": all(f.ok for f in findings),
                    "findings": [{"ok": f.ok, "text": f.text} for f in findings],
                }
            )
        )
    else:
        for finding in findings:
            _say(f"{'ok     ' if finding.ok else 'MISSING'}  {finding.text}")
    return 0 if all(f.ok for f in findings) else 1


def _run(options: argparse.Namespace) -> int:
    from firmware_bridge.runtime.drive import run

    drive = _course(load(options), options.settle, options.seconds)
    _prepare(options)
    report, status = run(
        drive.robot,
        drive.navigator,
        drive.period,
        drive.origin,
        options.record,
        _out(options),
        drive.note,
    )
    if options.json:
        _say(json.dumps({"scenario": drive.name, **report}))
    return status


class _Course(NamedTuple):
    """All that a run needs."""

    name: str
    robot: Robot
    navigator: Any
    period: float
    origin: tuple[float, float, float]
    note: str
    """What a user should know before it drives."""


def _course(
    robot: Robot, settle: float, seconds: float, watch: Callable[[Any, Any], None] | None = None
) -> _Course:
    """kmpc_lite's controller and scenario as the bridge wants them; `watch` is told each pose and plan."""
    import kmpc_lite as kl
    from firmware_bridge.runtime.navigator import Navigator, Task
    from kmpc_lite.sim import Scenario

    if robot.control.scenario is None:
        raise ConfigError(f"{robot.where}: control.scenario: missing: give --scenario NAME")
    try:
        scenario = Scenario.load(robot.control.scenario)
        controller = _controller(robot, scenario)
    except kl.KmpcError as error:
        raise ConfigError(str(error)) from error
    if robot.gate.geofence is None:
        x_min, y_min, x_max, y_max = scenario.bounds
        fence = (x_min - FENCE_ROOM, y_min - FENCE_ROOM, x_max + FENCE_ROOM, y_max + FENCE_ROOM)
        robot = replace(robot, gate=replace(robot.gate, geofence=fence))

    def step(pose: tuple[float, float, float], circles: Any) -> tuple[float, float, str]:
        obstacles = circles if scenario.solids is None else [*circles, *scenario.solids.solids]
        plan = controller.step(pose, scenario.goal, obstacles, sent=navigator.held() or UNKNOWN)
        if watch is not None:
            watch(pose, plan)
        return float(plan.command[0]), float(plan.command[1]), plan.status.name

    robot, note = _with_latency(robot, controller.model.history)
    task = Task(
        scenario.goal,
        scenario.tolerance,
        scenario.heading_tolerance,
        scenario.radius,
        scenario.circles_at,
    )
    origin = (
        (0.0, 0.0, 0.0) if robot.is_autopilot or robot.link.pose is not None else scenario.start
    )
    period = robot.control.period or controller.problem.dt
    navigator = Navigator(step, task, settle, seconds)
    return _Course(scenario.name, robot, navigator, period, origin, note)


def _with_latency(robot: Robot, history: int) -> tuple[Robot, str]:
    """Choose a latency where none is given, for a model with so many commands of history; and say so where it matters."""
    if robot.control.latency is not None:
        return robot, ""
    latency = 0.0 if history else NOMINAL_LATENCY[robot.link.driver]
    note = f"control.latency: not given, and the model knows no lag: {latency:g} s is taken for {robot.link.driver} (or kmpc fit --lags)"
    return replace(robot, control=replace(robot.control, latency=latency)), note if latency else ""


def _controller(robot: Robot, scenario: Any) -> Any:
    """kmpc_lite's controller for this map, within the robot's limits."""
    import kmpc_lite as kl

    model, period, limits = robot.control.model, robot.control.period, robot.gate.limits
    learned = kl.nominal_unicycle(period or 0.1) if model is None else kl.KoopmanModel.load(model)
    if period is not None and abs(period - learned.dt) > 1e-9:
        learned = learned.with_dt(period)
    base = kl.NavigationProblem(
        dt=learned.dt,
        horizon=min(100, max(20, round(LOOK_AHEAD / learned.dt))),
        u_min=(-limits.v_reverse, -limits.omega_max),
        u_max=(limits.v_max, limits.omega_max),
        deceleration=(limits.deceleration, limits.angular_deceleration),
    )
    adaptation = None if model is not None and robot.control.adaptation else False
    return kl.Controller(learned, scenario.problem(base), adaptation=adaptation)


def _record(options: argparse.Namespace) -> int:
    from firmware_bridge.runtime.drive import record

    robot = load(options)
    if options.by_hand and robot.sections.get("board", {}).get("arm"):
        raise ConfigError("--by-hand: the pilot arms and drives; leave board.arm and --arm out")
    excitation = None if options.by_hand else (options.hold, options.seed)
    period = robot.control.period or 0.1
    _prepare(options)
    report, status = record(
        robot,
        options.output,
        options.seconds,
        period=period,
        excitation=excitation,
        out=_out(options),
    )
    if options.json:
        _say(json.dumps(report))
    return status


def _prepare(options: argparse.Namespace) -> None:
    """Make the process fit for a control loop, where asked."""
    from kmpc_lite.realtime import prepare_process

    for line in prepare_process() if options.realtime else ():
        sys.stderr.write(f"{line}\n")


def _out(options: argparse.Namespace) -> TextIO | None:
    """Where to show people what happens."""
    return None if options.json else sys.stdout


def _replay(options: argparse.Namespace) -> int:
    from firmware_bridge.recording.replay import inspect_csv, replay

    if options.log.endswith(".csv"):
        if options.csv is not None or options.link is not None:
            raise ConfigError(
                f"{options.log}: --csv and --link take the .tlog or .raw log beside it"
            )
        report = inspect_csv(Path(options.log), options.mend)
    elif options.mend:
        raise ConfigError(
            f"{options.log}: --mend takes a .csv; a link log is read up to its last whole record as it is"
        )
    else:
        report = replay(
            Path(options.log),
            options.csv,
            options.period,
            options.system,
            options.link,
            options.speed,
        )
    if options.json:
        _say(json.dumps(report))
    else:
        for key, value in report.items():
            _say(f"{key:<12}{json.dumps(value) if isinstance(value, dict | list) else value}")
    return 0


def _emulate(options: argparse.Namespace) -> int:
    import kmpc_lite as kl
    from firmware_bridge.cli.emulate import build_emulator, emulate
    from kmpc_lite.sim import Scenario

    autopilot = options.robot == "mavlink"
    robot = load_robot(
        None if autopilot else options.robot,
        {
            "link": {
                "url": options.link,
                "driver": "mavlink" if autopilot else None,
                "pose": options.pose,
            }
        },
    )
    start, slip, turn_gain = (0.0, 0.0, 0.0), 0.0, 1.0
    if options.scenario is not None:
        try:
            scenario = Scenario.load(options.scenario)
        except kl.KmpcError as error:
            raise ConfigError(str(error)) from error
        start, slip, turn_gain = scenario.start, scenario.slip, scenario.turn_gain
    start = start if options.start is None else tuple(options.start)
    slip, turn_gain = (
        given if given is not None else own
        for given, own in ((options.slip, slip), (options.turn_gain, turn_gain))
    )
    try:
        twin = None
        if options.physics == "mujoco":
            from kmpc_lite.sim.twin import Twin

            twin = (
                Twin(seed=options.seed)
                if options.scenario is None
                else Twin.of(scenario, options.seed)
            )
        emulator = build_emulator(
            robot, start, slip, turn_gain, options.seed, options.arm_after, twin
        )
    except kl.KmpcError as error:
        raise ConfigError(str(error)) from error
    report = emulate(
        emulator, robot.link.url, options.seconds, _out(options), options.pose, options.seed
    )
    if options.json:
        _say(json.dumps(report))
    return 0


def _estop(options: argparse.Namespace) -> int:
    assert options.word in WORDS
    path = Path(options.socket) if options.socket else default_socket()
    try:
        answer = ask(path, options.word)
    except LinkError as error:
        if options.word in ("stop", "reset"):
            set_latch(path, options.word == "stop")
        answer = {
            "ok": False,
            "latched": latch_file(path).exists(),
            "gate": None,
            "confirmed": False,
            "error": str(error),
        }
    if options.json:
        _say(json.dumps(answer))
    elif answer["gate"] is None:
        _say(
            f"{answer['error']}; "
            + (
                "the next one will not drive before a reset"
                if answer["latched"]
                else "no stop is pressed"
            )
        )
    else:
        pressed = "pressed" if answer["latched"] else "not pressed"
        _say(f"emergency stop {pressed}, gate {answer['gate']}")
        for why in answer.get("why", ()):
            _say(f"  {why}")
    done = answer["ok"] and (options.word != "stop" or answer["confirmed"])
    return 0 if done or (options.word == "reset" and not answer["latched"]) else 1


def _latency(options: argparse.Namespace) -> int:
    from firmware_bridge.cli.latency import SCENARIO, measure, table

    def drive(robot: Robot) -> dict[str, Any]:
        from firmware_bridge.runtime.drive import run

        course = _course(
            replace(robot, control=replace(robot.control, scenario=SCENARIO)),
            options.seconds,
            options.seconds,
        )
        return run(course.robot, course.navigator, course.period, course.origin, None, None)[0]

    rows = measure(options.drivers, options.rates, drive, None if options.json else sys.stderr)
    _say(json.dumps(rows) if options.json else table(rows))
    return 0


def _demo(options: argparse.Namespace) -> int:
    import kmpc_lite as kl
    from firmware_bridge.cli.demo import demo

    command = "kmpc-bridge " + " ".join(sys.argv[1:])
    try:
        report, status = demo(
            options.output, options.seconds, options.seed, _course, _out(options), command
        )
    except kl.KmpcError as error:
        raise ConfigError(str(error)) from error
    if options.json:
        _say(json.dumps(report))
    return status


COMMANDS = {
    "check": _check,
    "run": _run,
    "record": _record,
    "replay": _replay,
    "emulate": _emulate,
    "estop": _estop,
    "latency": _latency,
    "demo": _demo,
}

if __name__ == "__main__":
    sys.exit(main())
