"""kmpc-bridge: check a robot, drive it, record it, play it back, stop it, or pretend to be one.

Every command has --help with an example and --json; bad input ends in one line and exit status 2.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

# one BLAS thread: more would only get in the gate's way; NumPy reads this when it is loaded
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from firmware_bridge.estop import WORDS, ask, default_socket, latch_file, set_latch  # noqa: E402
from firmware_bridge.messages import BridgeError, ConfigError, LinkError  # noqa: E402
from firmware_bridge.robot_file import DRIVERS, Robot, load_robot  # noqa: E402

INTERRUPTED = 130
FENCE_ROOM = 0.25
"""Without a geofence of its own a robot may leave the scenario's area by so much [m]."""
LOOK_AHEAD = 2.0
"""Time that the controller plans ahead, however short its period [s]."""
DRIVE_TIME = 120.0
"""How long a run may take unless told [s]: low speeds take longer than a scenario's own limit."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status: 0 done, 1 not done, 2 bad input, 130 interrupted."""
    options = _parser().parse_args(arguments)
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


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="kmpc-bridge", description="Drive a robot's motors, safely.")
    commands = parser.add_subparsers(required=True, metavar="command")

    def command(name: str, run: Any, text: str, example: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text, epilog=f"example:\n  {example}", formatter_class=raw)
        sub.set_defaults(run=run)
        sub.add_argument("--json", action="store_true", help="one JSON object on standard output, for machines")
        return sub

    sub = command("check", _check, "say who answers, and what is missing before it can drive", "kmpc-bridge check robot.toml")
    _robot_options(sub)
    sub.add_argument("--seconds", type=_positive, default=2.0, help="how long to watch the telemetry [s] (default 2)")

    sub = command(
        "run",
        _run,
        "drive a scenario with a learned model",
        "kmpc-bridge run --driver mavlink --link tcp:127.0.0.1:5760 --model robot.npz --scenario four_circles_1 --arm",
    )
    _robot_options(sub)
    _drive_options(sub)
    sub.add_argument("--model", help="learned model (kmpc fit); the nominal unicycle where not given")
    sub.add_argument("--scenario", help="scenario file, or the name of one that comes with kmpc_lite")
    sub.add_argument("--seconds", type=_positive, default=DRIVE_TIME, help=f"give up after so long [s] (default {DRIVE_TIME:g})")
    sub.add_argument("--settle", type=_positive, default=1.0, help="how long the goal must be held [s] (default 1)")
    sub.add_argument("--record", metavar="NAME", help="record to NAME.csv and NAME.tlog or NAME.raw")

    sub = command(
        "record",
        _record,
        "record a drive to learn from: by hand, or at random inside a fence",
        "kmpc-bridge record robot.toml --excite --geofence -2 -2 2 2 --seconds 300 --output drive",
    )
    _robot_options(sub)
    _drive_options(sub)
    sub.add_argument("--output", required=True, metavar="NAME", help="record to NAME.csv and NAME.tlog or NAME.raw")
    how = sub.add_mutually_exclusive_group(required=True)
    how.add_argument("--by-hand", action="store_true", help="somebody else drives; nothing is sent to the robot")
    how.add_argument("--excite", action="store_true", help="drive at random in the four sign scenarios, inside the geofence")
    sub.add_argument("--seconds", type=_positive, default=300.0, help="for how long [s] (default 300)")
    sub.add_argument("--hold", type=_positive, default=0.5, help="how long a random command is held [s] (default 0.5)")
    sub.add_argument("--seed", type=int, default=0, help="of the random commands (default 0)")

    sub = command(
        "replay",
        _replay,
        "summarise a recorded link log, make a CSV of it, or play it to a link",
        "kmpc-bridge replay drive.tlog --csv a.csv",
    )
    sub.add_argument("log", help="NAME.tlog or NAME.raw")
    sub.add_argument("--csv", metavar="FILE", help="write the poses and measured speeds of a tlog as a log for kmpc fit")
    sub.add_argument("--period", type=_positive, default=0.1, help="of the CSV's rows [s] (default 0.1)")
    sub.add_argument("--system", type=int, default=1, help="MAVLink id of the vehicle (default 1)")
    sub.add_argument("--link", metavar="URL", help="serve what came from the board here, for a ground station")
    sub.add_argument("--speed", type=_positive, default=1.0, help="pace on --link (default 1)")

    sub = command(
        "emulate",
        _emulate,
        "pretend to be a robot: an ArduPilot rover, or a motor controller of a robot file",
        "kmpc-bridge emulate mavlink --link tcp:127.0.0.1:5760",
    )
    sub.add_argument("robot", help="mavlink, or a robot file")
    sub.add_argument("--link", metavar="URL", help="pty:PATH, tcp:HOST:PORT or udp:HOST:PORT; the robot file's where not given")
    sub.add_argument("--scenario", help="start where this one starts, on its floor")
    sub.add_argument("--start", nargs=3, type=float, metavar=("X", "Y", "THETA"), help="where it stands [m, m, rad]")
    sub.add_argument("--slip", type=float, help="mean slip ratio of the floor")
    sub.add_argument("--turn-gain", type=float, help="share of a turn that happens")
    sub.add_argument("--seed", type=int, default=0, help="of the slip (default 0)")
    sub.add_argument("--arm-after", type=float, default=2.0, help="arming is refused so long after boot [s] (default 2)")
    sub.add_argument("--seconds", type=_positive, help="end after so long [s]")

    sub = command("estop", _estop, "stop the robot that a running bridge drives, and keep it stopped", "kmpc-bridge estop")
    what = sub.add_mutually_exclusive_group()
    what.add_argument("--reset", dest="word", action="store_const", const="reset", help="clear the stop; the robot stays still")
    what.add_argument("--enable", dest="word", action="store_const", const="enable", help="let the robot drive (again)")
    what.add_argument("--status", dest="word", action="store_const", const="status", help="what the gate is doing")
    sub.add_argument("--socket", metavar="PATH", help="of the bridge, where not the default")
    sub.set_defaults(word="stop")
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"expected a number > 0, got {text}")
    return value


def _robot_options(sub: argparse.ArgumentParser) -> None:
    """Where the robot is and what it may do; each replaces a key of the robot file."""
    sub.add_argument("robot", nargs="?", help="robot file (TOML); the options below replace its keys")
    sub.add_argument("--driver", choices=DRIVERS, help="link.driver")
    sub.add_argument("--link", metavar="URL", help="link.url: serial:PATH?baud=..., pty:PATH, tcp:HOST:PORT, udp:HOST:PORT")
    sub.add_argument("--timeout", type=float, help="link.timeout: how long the board may take to answer [s]")
    sub.add_argument("--v-max", type=float, help="limits.v_max and v_reverse [m/s]; slow where not given")
    sub.add_argument("--omega-max", type=float, help="limits.omega_max [rad/s]")
    sub.add_argument("--geofence", nargs=4, type=float, metavar=("XMIN", "YMIN", "XMAX", "YMAX"), help="safety.geofence [m]")
    sub.add_argument("--socket", metavar="PATH", help="safety.socket: of the emergency stop")
    sub.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="any other key, in TOML: board.rate=50")


def _drive_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--arm", action="store_true", help="arm an autopilot and choose GUIDED; else the pilot does both")
    sub.add_argument("--period", type=float, help="control.period [s]; the model's where not given")
    sub.add_argument("--command-period", type=float, help="control.command_period: of commands on the wire [s] (default 0.02)")
    sub.add_argument("--realtime", action="store_true", help="ask for real-time priority, and say what was not permitted")
    sub.add_argument("--latency", type=float, help="control.latency: from the wire to the wheels [s] (default 0)")


def load(options: argparse.Namespace) -> Robot:
    """Read the robot file under the options of a command line."""
    given = vars(options)
    overrides: dict[str, dict[str, Any]] = {
        "link": {"url": given.get("link"), "driver": given.get("driver"), "timeout": given.get("timeout")},
        "board": {"arm": True if given.get("arm") else None},
        "limits": {"v_max": given.get("v_max"), "v_reverse": given.get("v_max"), "omega_max": given.get("omega_max")},
        "safety": {"geofence": given.get("geofence"), "socket": given.get("socket")},
        "control": {name: given.get(name) for name in ("period", "command_period", "latency", "model", "scenario")},
    }
    for item in given.get("set", []):
        name, equals, value = item.partition("=")
        section, dot, key = name.strip().partition(".")
        try:
            if not (equals and dot):
                raise ValueError
            overrides.setdefault(section, {})[key] = tomllib.loads(f"value = {value}")["value"]
        except ValueError:
            raise ConfigError(f'--set {item}: expected SECTION.KEY=VALUE with a TOML value (text in quotes: board.role="gcs")') from None
    robot = load_robot(given.get("robot"), overrides)
    if given.get("arm") and not robot.is_autopilot:
        raise ConfigError(f"--arm: only an autopilot is armed; {robot.link.driver} drives as soon as the bridge runs")
    return robot


def _check(options: argparse.Namespace) -> int:
    from firmware_bridge.check import check

    findings = check(load(options), options.seconds)
    if options.json:
        _say(json.dumps({"ok": all(f.ok for f in findings), "findings": [{"ok": f.ok, "text": f.text} for f in findings]}))
    else:
        for finding in findings:
            _say(f"{'ok     ' if finding.ok else 'MISSING'}  {finding.text}")
    return 0 if all(f.ok for f in findings) else 1


def _run(options: argparse.Namespace) -> int:
    import kmpc_lite as kl
    from firmware_bridge.drive import run
    from firmware_bridge.navigator import Navigator, Task
    from kmpc_lite.sim import Scenario

    robot = load(options)
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
        plan = controller.step(pose, scenario.goal, circles)
        return float(plan.command[0]), float(plan.command[1]), plan.status.name

    task = Task(scenario.goal, scenario.tolerance, scenario.heading_tolerance, scenario.radius, scenario.circles_at)
    navigator = Navigator(step, task, options.settle, options.seconds)
    _prepare(options)
    origin = (0.0, 0.0, 0.0) if robot.is_autopilot else scenario.start
    period = robot.control.period or controller.problem.dt
    report, status = run(robot, navigator, period, origin, options.record, _out(options))
    if options.json:
        _say(json.dumps({"scenario": scenario.name, **report}))
    return status


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
    return kl.Controller(learned, scenario.problem(base))


def _record(options: argparse.Namespace) -> int:
    from firmware_bridge.drive import record

    robot = load(options)
    if options.by_hand and robot.sections.get("board", {}).get("arm"):
        raise ConfigError("--by-hand: the pilot arms and drives; leave board.arm and --arm out")
    excitation = None if options.by_hand else (options.hold, options.seed)
    period = robot.control.period or 0.1
    _prepare(options)
    report, status = record(robot, options.output, options.seconds, period=period, excitation=excitation, out=_out(options))
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
    from firmware_bridge.replay import replay

    report = replay(Path(options.log), options.csv, options.period, options.system, options.link, options.speed)
    if options.json:
        _say(json.dumps(report))
    else:
        for key, value in report.items():
            _say(f"{key:<12}{json.dumps(value) if isinstance(value, dict | list) else value}")
    return 0


def _emulate(options: argparse.Namespace) -> int:
    import kmpc_lite as kl
    from firmware_bridge.emulate import build_emulator, emulate
    from kmpc_lite.sim import Scenario

    autopilot = options.robot == "mavlink"
    robot = load_robot(None if autopilot else options.robot, {"link": {"url": options.link, "driver": "mavlink" if autopilot else None}})
    start, slip, turn_gain = (0.0, 0.0, 0.0), 0.0, 1.0
    if options.scenario is not None:
        try:
            scenario = Scenario.load(options.scenario)
        except kl.KmpcError as error:
            raise ConfigError(str(error)) from error
        start, slip, turn_gain = scenario.start, scenario.slip, scenario.turn_gain
    start = start if options.start is None else tuple(options.start)
    slip, turn_gain = (given if given is not None else own for given, own in ((options.slip, slip), (options.turn_gain, turn_gain)))
    try:
        emulator = build_emulator(robot, start, slip, turn_gain, options.seed, options.arm_after)
    except kl.KmpcError as error:
        raise ConfigError(str(error)) from error
    report = emulate(emulator, robot.link.url, options.seconds, _out(options))
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
        answer = {"ok": False, "latched": latch_file(path).exists(), "gate": None, "confirmed": False, "error": str(error)}
    if options.json:
        _say(json.dumps(answer))
    elif answer["gate"] is None:
        _say(f"{answer['error']}; " + ("the next one will not drive before a reset" if answer["latched"] else "no stop is pressed"))
    else:
        pressed = "pressed" if answer["latched"] else "not pressed"
        _say(f"emergency stop {pressed}, gate {answer['gate']}")
    done = answer["ok"] and (options.word != "stop" or answer["confirmed"])
    return 0 if done or (options.word == "reset" and not answer["latched"]) else 1


if __name__ == "__main__":
    sys.exit(main())
