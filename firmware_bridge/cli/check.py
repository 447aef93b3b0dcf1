"""`kmpc check`: what answers, and what is missing before it can drive, in words to act on."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import dataclass, replace
from typing import Any

from firmware_bridge.cli.options import add_robot_options, read_robot
from firmware_bridge.drivers import Driver
from firmware_bridge.integration.course import misplaced, own_frame, scenario_of
from firmware_bridge.integration.model_gate import describe_model
from firmware_bridge.link import open_transport
from firmware_bridge.messages import BridgeError, LidarError, LinkError, VelocityCommand
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.runtime.timing import listen
from firmware_bridge.safety.estop_client import NoBridge, ask
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_table import Reason
from firmware_bridge.safety.places import default_socket, is_latched
from firmware_bridge.sensors.sensor_driver import autopilot_of, placed
from kmpc_lite.cli.command import Command, paint, positive

PREARM = 1.0  # how long an autopilot may take to say what keeps it from arming [s]
WOULD_DRIVE = "the safety gate would let it drive now"
ADVICE = {
    Reason.LINK: "plug the cable in, or start the vehicle's end of the link",
    Reason.HEARTBEAT: "is the board powered, and is the telemetry frequent enough? "
    "safety.heartbeat_age is the limit",
    Reason.BOARD: "see the fault above",
    Reason.ESTIMATE: "wait for the position estimate, check GPS, motion capture or encoders",
    Reason.POSE: "poses must come at least every safety.pose_age seconds",
    Reason.POSE_INVALID: "the board sends poses that are not numbers: check its sensors",
    Reason.SCAN: "see the lidar's lines; a turn must come at least every safety.scan_age seconds",
    Reason.FRAME: "look whether the robot is shown where it is",
    Reason.GEOFENCE: "the robot stands outside safety.geofence: carry or drive it inside, "
    "or check the frame",
    Reason.NOT_READY: "a motor controller is taken when the bridge runs",
}
"""What a user can do, in the order in which it is done."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    ok: bool
    text: str


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_robot_options(parser)
    text = (
        "control.scenario: check that the robot stands clear of its obstacles, and that the "
        "lidar agrees with its map"
    )
    parser.add_argument("--scenario", dest="control.scenario", metavar="NAME", help=text)
    text = "how long to watch the telemetry [s] (default: 2)"
    parser.add_argument("--seconds", type=positive, metavar="S", default=2.0, help=text)
    text = "control.model: whether this model suits the robot"
    parser.add_argument("--model", dest="control.model", metavar="FILE", help=text)


def run(options: argparse.Namespace) -> int:
    """Print what was found; status 1 where something is missing."""
    findings = check(read_robot(options), options.seconds)
    fine = all(finding.ok for finding in findings)
    if options.json:
        found = [{"ok": finding.ok, "text": finding.text} for finding in findings]
        print(json.dumps({"ok": fine, "findings": found}))
        return 0 if fine else 1
    for finding in findings:
        mark = ("ok     ", "green") if finding.ok else ("MISSING", "red")
        print(f"{paint(*mark, sys.stdout)}  {finding.text}")
    return 0 if fine else 1


def check(robot: Robot, seconds: float) -> list[Finding]:
    """Look at everything short of moving the robot.

    `robot`: what to look at. `seconds`: how long to watch the telemetry [s]. Raises ConfigError for
    a wrong key.
    """
    found = [Finding(True, f"{robot.where}: {robot.link.driver} at {robot.link.url}")]
    found += [Finding(ok, text) for ok, text in describe_model(robot)]
    found += _estop(robot)
    return found + _answers(robot, seconds)


def _answers(robot: Robot, seconds: float) -> list[Finding]:
    """What answers, and what the gate would say; if the lidar does not, what the board says."""
    driver = open_driver(robot, open_transport(robot.link.url))
    try:
        driver.connect(robot.link.timeout)
        found = _telemetry(driver, robot, seconds)
        if robot.lidar is not None:
            found += _sight(driver, robot, seconds)
        return [*found, *_place(driver, robot), *_judgement(driver, robot)]
    except LidarError as error:
        driver.close()
        others = _answers(replace(robot, lidar=None), seconds)
        return [Finding(False, str(error)), *(f for f in others if f.text != WOULD_DRIVE)]
    except LinkError as error:
        return [Finding(False, str(error))]
    finally:
        driver.close()


def _estop(robot: Robot) -> list[Finding]:
    path = default_socket() if robot.socket is None else robot.socket
    try:
        ask(path, "status")
    except NoBridge:
        if is_latched(path):
            return [Finding(False, "the emergency stop is pressed: kmpc estop --reset")]
        return [Finding(True, f"emergency stop: not pressed, at {path}")]
    except LinkError as error:
        return [Finding(False, f"emergency stop: {error}")]
    return [
        Finding(
            False, f"another bridge is running ({path}): two masters on one robot; stop it first"
        )
    ]


def _telemetry(driver: Driver, robot: Robot, seconds: float) -> list[Finding]:
    """Rate and age of poses, and what the board says of itself."""
    state, gaps, ages = listen(driver.state, seconds)
    found = []
    if state is None:
        found.append(Finding(False, f"no pose within {seconds:g} s"))
    else:
        text = (
            f"pose: x {state.x:.3f} m, y {state.y:.3f} m, theta {state.theta:.3f} rad; "
            f"{ages.count / seconds:.0f} Hz, {1e3 * ages.quantile(0.5):.0f} ms old when it comes "
            f"(at most {1e3 * ages.maximum:.0f}), gaps up to {1e3 * gaps.maximum:.0f} ms"
        )
        found.append(Finding(gaps.count > 0 and gaps.maximum <= robot.gate.pose_age, text))
    status = driver.health()
    found.append(
        Finding(
            status.connected,
            f"board: {status.mode or 'no modes'}, {'armed' if status.armed else 'not armed'}",
        )
    )
    found += [Finding(False, f"board: {fault}") for fault in status.faults]
    autopilot = autopilot_of(driver)
    notes = () if autopilot is None else autopilot.notes()
    return found + [Finding(True, f"note: {note}") for note in notes]


def _sight(driver: Any, robot: Robot, seconds: float) -> list[Finding]:
    """What the lidar sees."""
    from firmware_bridge.cli.lidar_check import look  # NumPy only for robots that see

    return [Finding(ok, text) for ok, text in look(driver, robot, seconds)]


def _place(driver: Driver, robot: Robot) -> list[Finding]:
    """Whether the robot can stand in its scenario where its pose says."""
    state = driver.state()
    if robot.control.scenario is None or not robot.control.map or state is None:
        return []
    scenario = scenario_of(robot)
    here = placed(state, own_frame(robot, scenario))
    wrong = misplaced(scenario, (here.x, here.y, here.theta))
    return [Finding(False, wrong)] if wrong else []


def _judgement(driver: Driver, robot: Robot) -> list[Finding]:
    """What the safety gate would say if a controller ran, in the order in which a user mends it."""
    refusals = _prearm(driver)
    now = time.monotonic()
    state, status = driver.state(), driver.health()
    command = VelocityCommand(0.0, 0.0, now)
    reasons = set(SafetyGate(robot.gate).step(now, command, state, status).reasons)
    fresh = now - status.heartbeat_stamp if math.isfinite(status.heartbeat_stamp) else math.inf
    pilot = robot.gate.pilot and Reason.NOT_READY in reasons
    found = []
    for reason in (reason for reason in ADVICE if reason in reasons):
        if pilot and reason is Reason.NOT_READY:
            continue
        detail = f" ({fresh:.2f} s)" if reason is Reason.HEARTBEAT else ""
        found.append(Finding(False, f"{reason.value}{detail}: {ADVICE[reason]}"))
    found += [Finding(False, f"the autopilot would not arm: {text}") for text in refusals]
    if pilot and not found:
        text = f"not given to us yet: {status.mode}, {'' if status.armed else 'not '}armed"
        found.append(Finding(True, f"{text}; run --arm takes it, or the pilot gives it"))
    if not found:
        found.append(Finding(True, WOULD_DRIVE))
    return found


def _prearm(driver: Driver) -> tuple[str, ...]:
    """Ask an autopilot that is not armed what keeps it from arming, in its own words."""
    autopilot = autopilot_of(driver)
    if autopilot is None or autopilot.health().armed:
        return ()
    autopilot.ask_prearm()
    time.sleep(PREARM)
    return autopilot.refusals()


COMMAND = Command(
    text="Report what answers, and what is missing before the robot can drive. It does not move.",
    examples=(
        "kmpc check robot.toml",
        "kmpc check robot.toml --model robot.npz",
        "kmpc check --driver mavlink --link udp:127.0.0.1:14550",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
