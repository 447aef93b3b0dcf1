"""What `kmpc run` does with a session, and its report."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Protocol, TextIO

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.drive_logs import Recorder
from firmware_bridge.runtime.loop import FINISHED
from firmware_bridge.runtime.navigator import Moment, Navigator, Route
from firmware_bridge.runtime.observer import Observer
from firmware_bridge.runtime.session import STOPS, Session, ended_words, told_once
from firmware_bridge.runtime.timing import table
from firmware_bridge.safety.gate import GateOutput, SafetyGate
from firmware_bridge.safety.gate_table import GateState

DONE, NOT_DONE, INTERRUPTED = 0, 1, 130
SIGNALS = frozenset(s.name for s in STOPS)
Pose = tuple[float, float, float]
Watched = Callable[[Session], AbstractContextManager[object]]
"""Displays a session while the context lasts."""


class Examiner(Observer, Protocol):
    """Looks on while a robot drives, and may have it stopped: see `Rehearsal`."""

    @property
    def trouble(self) -> str:
        """Why the robot must be stopped, in words; else empty."""

    def finish(self) -> dict[str, Any]:
        """What it has found, for JSON: `text` among it."""


class Restart:
    """Enables a robot that was given back when a goal comes, which is as deliberate as a word.

    It never resets an emergency stop.

    `route`: takes goals. `gate`: gives the gate.
    """

    def __init__(self, route: Route, gate: Callable[[], SafetyGate]) -> None:
        self._route, self._gate, self._seen = route, gate, route.goals

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Look for a new goal."""
        if self._route.goals is not self._seen:
            self._seen = self._route.goals
            if output.state in (GateState.RELEASED, GateState.IDLE):
                self._gate().enable()


def run(
    robot: Robot,
    navigator: Navigator,
    period: float,
    origin: Pose,
    output: str | None,
    out: TextIO | None,
    notes: tuple[str, ...] = (),
    watched: Watched = nullcontext,
    recorder: Callable[[Session, Path], Recorder] | None = None,
    examiner: Examiner | None = None,
    driver: Driver | None = None,
) -> tuple[dict[str, Any], int]:
    """Drive to the goal; return the report and the exit status.

    `robot`: what to drive. `navigator`: plans and knows when it has arrived. `period`: of the
    controller [s]. `origin`: pose of the vehicle's own frame [m, m, rad], where the robot file has
    none. `output`: record to files of this name. `out`: for people; nothing is written if not
    given. `notes`: said on standard error once the board has answered, before it drives. `watched`:
    makes a context of the session, in which it drives. `recorder`: makes another recorder; see
    `Session`. `examiner`: looks on, and may have the robot stopped. `driver`: of a robot without a
    link of bytes. A new goal lets it drive again after it was given back.
    """

    def plan(state: State) -> VelocityCommand:
        return navigator(state, _moment(session, state))

    restart = None if driver is None else Restart(navigator.route, lambda: session.gate)

    def trouble() -> str:
        return navigator.refused or ("" if examiner is None else examiner.trouble)

    with Session(
        robot,
        plan,
        period,
        origin=origin,
        output=None if output is None else Path(output),
        out=out,
        driver=driver,
        observers=tuple(filter(None, (examiner, restart))),
        record=recorder,
        more=lambda: list(filter(None, (navigator.route.words,))),
        warnings=lambda: (*navigator.passed, *getattr(driver, "warnings", tuple)()),
    ) as session:
        sys.stderr.write("".join(f"kmpc: {note}\n" for note in notes))

        def finished() -> bool:
            if trouble() and not session.loop.stop_reason:
                session.loop.request_stop(trouble())
                return False
            return navigator.finished()

        with watched(session):
            session.drive(finished)
            navigator.look(session.driver.state())
        interrupted = session.loop.stop_reason in SIGNALS
        examined = {} if examiner is None else {"rehearsal": examiner.finish()}
        ended = ending(navigator, session)
        report = {**ended, **navigator.report(), **session.report(), **examined}
        report["notes"] = list(notes)
        session.logs.finish(report)
    report["problems"] = session.problems()  # counted after the session has closed its files
    if out is not None:
        tell(report, session, out)
    if _did_it(navigator) and not navigator.touched and not trouble():
        return report, INTERRUPTED if interrupted and not navigator.arrived else DONE
    return report, INTERRUPTED if interrupted else NOT_DONE


def _moment(session: Session, state: State) -> Moment:
    """What the session knows now, for a plan from this pose."""
    scan = None if session.sight is None else session.sight.look(state)
    driving = session.gate.state is GateState.ACTIVE
    return Moment(driving, session.planner.held, scan, session.loop.drove_from, state.stamp)


def _did_it(navigator: Navigator) -> bool:
    """Whether the last goal is held; in a loop, whether each goal was."""
    return navigator.arrived or (navigator.route.loop and navigator.route.rounds > 0)


def ending(navigator: Navigator, session: Session) -> dict[str, Any]:
    """How a run ended, for JSON: `outcome`, `why`, and both in one sentence, `ended`."""
    stop = session.loop.stop_reason
    stop = "" if stop == FINISHED else stop
    outcome = outcome_words(navigator, stop)
    why: list[str] = []
    if not navigator.arrived and (not stop or stop in SIGNALS):
        controller = f"the controller: {navigator.reason}" if navigator.reason else ""
        why = told_once(session.loop.why_stopped, session.words())
        why += filter(None, (controller,))
    ended = ""
    if not navigator.arrived or navigator.touched:
        told = navigator.report()["duration_s"], navigator.errors(), navigator.route.words
        ended = ended_words(outcome, *told, why)
    return {"outcome": outcome, "ended": ended, "why": why}


def outcome_words(navigator: Navigator, stop: str) -> str:
    """Outcome of a run, in words; `stop` is the signal or the trouble that ended it, if any."""
    if navigator.arrived:
        outcome = "arrived"
    elif navigator.arrived_after is not None:
        outcome = "left the goal again while stopping"
    elif navigator.refused:
        outcome = f"not driven: {navigator.refused}"
    elif stop:
        outcome = f"stopped by {stop}"
    else:
        outcome = "time is up" if navigator.drove else "never drove"
    held, count = navigator.route.held, len(navigator.route.goals)
    if count > 1 and navigator.drove:
        outcome += (
            f", {held} goals held in turn" if navigator.route.loop else f", {held} of {count} goals"
        )
    return f"touched an obstacle, {outcome}" if navigator.touched else outcome


def tell(report: dict[str, Any], session: Session, out: TextIO) -> None:
    """Summary of a run, for people."""

    def show(value: float | None, unit: str) -> str:
        return "-" if value is None else f"{value:g} {unit}"

    loop = report["loop"]
    lines = [
        "",
        f"{report['outcome']}: after {report['duration_s']:g} s, "
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
    lines += [f"why: {report['ended']}"] if report["ended"] else []
    if "rehearsal" in report:
        lines.append(f"rehearsal: {report['rehearsal']['text']}")
    lines += [f"recorded to {', '.join(report['files'])}"] if report["files"] else []
    out.write("\n".join([*lines, *report["problems"]]) + "\n")
