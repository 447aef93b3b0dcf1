"""What `kmpc run` and `kmpc record` do with a session, and their reports."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, TextIO

from firmware_bridge.messages import ConfigError, State, VelocityCommand
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.navigator import Navigator
from firmware_bridge.runtime.session import STOPS, Session
from firmware_bridge.runtime.timing import table
from firmware_bridge.safety.gate_table import GateState

DONE, NOT_DONE, INTERRUPTED = 0, 1, 130
SIGNALS = frozenset(s.name for s in STOPS)
Pose = tuple[float, float, float]
Watched = Callable[[Session], AbstractContextManager[object]]
"""Shows a session to somebody while the context lasts."""


def run(
    robot: Robot,
    navigator: Navigator,
    period: float,
    origin: Pose,
    output: str | None,
    out: TextIO | None,
    note: str = "",
    watched: Watched = nullcontext,
) -> tuple[dict[str, Any], int]:
    """Drive to the goal; return the report and the exit status.

    Parameters
    ----------
    robot : Robot
        What to drive.
    navigator : Navigator
        Plans and knows when it has arrived.
    period : float
        Of the controller [s].
    origin : tuple
        Pose of the vehicle's own frame [m, m, rad], where the robot file has none.
    output : str, optional
        Record to files of this name.
    out : text stream, optional
        For people; nothing is written where not given.
    note : str
        Said on standard error once the board has answered, before it drives.
    watched : callable
        Makes a context of the session, in which it drives.
    """
    with Session(
        robot,
        navigator,
        period,
        origin=origin,
        output=None if output is None else Path(output),
        out=out,
    ) as session:
        if note:
            sys.stderr.write(f"kmpc: {note}\n")
        navigator.is_driving, navigator.held = (
            lambda: session.gate.state is GateState.ACTIVE,
            lambda: session.planner.held,
        )
        why: list[str] = []

        def finished() -> bool:
            done = navigator.finished()
            if done and not why:
                why.extend(session.why())
            return done

        with watched(session):
            session.drive(finished)
        navigator.look(session.driver.state())
        report = {"outcome": "", **navigator.report(), "why": [], **session.report()}
        interrupted = session.loop.stop_reason in SIGNALS
        report["outcome"] = _outcome(navigator, session.loop.stop_reason if interrupted else "")
        if not navigator.arrived:
            report["why"] = why or session.why()
    report["problems"] = session.problems()  # counted after the session has closed its files
    if out is not None:
        tell(report, session, out)
    if navigator.arrived and not navigator.touched:
        return report, DONE
    return report, INTERRUPTED if interrupted else NOT_DONE


def _outcome(navigator: Navigator, signal: str) -> str:
    """Outcome of a run, in words; `signal` is the one that ended it, if any."""
    if navigator.arrived:
        outcome = "arrived"
    elif navigator.arrived_after is not None:
        outcome = "left the goal again while stopping"
    elif signal:
        outcome = f"stopped by {signal}"
    else:
        outcome = "time is up" if navigator.drove else "never drove"
    return f"touched an obstacle, {outcome}" if navigator.touched else outcome


def record(
    robot: Robot,
    output: str,
    seconds: float,
    *,
    period: float,
    excitation: tuple[float, int] | None,
    out: TextIO | None,
) -> tuple[dict[str, Any], int]:
    """Record a drive to learn from; return the report and the exit status.

    Parameters
    ----------
    robot : Robot
        What to drive, or to listen to.
    output : str
        Name of the files.
    seconds : float
        For how long, from the first moment in which it counts [s].
    period : float
        Of the rows, and of the random driving [s].
    excitation : tuple, optional
        How long a random command is held [s] and the seed; None: somebody drives by hand.
    out : text stream, optional
        For people.
    """
    controller = (
        Excitation(_fence(robot), robot.gate.limits, excitation[0], seed=excitation[1])
        if excitation
        else _nothing
    )
    with Session(
        robot, controller, period, output=Path(output), by_hand=excitation is None, out=out
    ) as session:
        began: list[float] = []

        def finished() -> bool:
            if not began and (excitation is None or session.gate.state is GateState.ACTIVE):
                began.append(time.monotonic())
            return bool(began) and time.monotonic() - began[0] > seconds

        session.drive(finished)
        report = {"outcome": "recorded", **session.report()}
        interrupted = session.loop.stop_reason in SIGNALS
    # counted after the session has closed its files
    report["rows"], report["problems"] = session.rows, (problems := session.problems())
    if out is not None:
        out.write(f"{session.rows} rows every {period:g} s in {', '.join(report['files'])}\n")
        out.write("".join(f"{p}\n" for p in problems))
    if not session.rows or problems:
        return report, NOT_DONE
    return report, INTERRUPTED if interrupted and not session.rows else DONE


def tell(report: dict[str, Any], session: Session, out: TextIO) -> None:
    """Summary of a run, for people."""

    def show(value: float | None, unit: str) -> str:
        return "-" if value is None else f"{value:g} {unit}"

    loop = report["loop"]
    lines = [
        "",
        f"{report['outcome']}: after {show(report['arrived_after_s'], 's')}, "
        f"position error {show(report['position_error_m'], 'm')}, "
        f"heading error {show(report['heading_error_rad'], 'rad')}, "
        f"smallest clearance {show(report['clearance_m'], 'm')}",
        f"{loop['commands_sent']} commands sent, {loop['commands_refused']} refused by the link, "
        f"{loop['ticks_skipped']} of {loop['ticks']} gate periods and "
        f"{loop['controller_periods_skipped']} controller periods skipped",
        "plans: "
        f"{', '.join(f'{name} {count}' for name, count in report['statuses'].items()) or 'none'}",
        "",
        table(session.loop.histograms()),
    ]
    if loop["last_error"]:
        lines.append(
            f"{loop['errors'] + loop['controller_errors']} errors, the last: {loop['last_error']}"
        )
    lines += [f"why: {why}" for why in report["why"]]
    lines += [f"recorded to {', '.join(report['files'])}"] if report["files"] else []
    out.write("\n".join([*lines, *report["problems"]]) + "\n")


def _fence(robot: Robot) -> tuple[float, float, float, float]:
    if robot.gate.geofence is None:
        raise ConfigError(
            f"{robot.where}: safety.geofence: missing: random driving needs [xmin, ymin, xmax, "
            "ymax] (--geofence), free of obstacles"
        )
    return robot.gate.geofence


def _nothing(state: State) -> VelocityCommand:
    """Command zero: somebody drives by hand, and the idle gate passes no command."""
    return VelocityCommand(0.0, 0.0, state.stamp)
