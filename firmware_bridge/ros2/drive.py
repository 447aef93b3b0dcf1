"""What `kmpc ros2` does with a session, and its report."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.robot_file import Robot
from firmware_bridge.ros2.driver import Ros2Driver
from firmware_bridge.ros2.inputs import Goal, Inputs
from firmware_bridge.ros2.navigator import GoalNavigator
from firmware_bridge.ros2.telling import Telling
from firmware_bridge.runtime.drive import DONE, INTERRUPTED, NOT_DONE, SIGNALS
from firmware_bridge.runtime.drive_logs import Recorder
from firmware_bridge.runtime.reasons import ended_words, told_once
from firmware_bridge.runtime.session import Session
from firmware_bridge.runtime.timing import table
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import GateState


@dataclass(frozen=True)
class Errand:
    """How long to drive, and where to."""

    period: float
    """Of the controller [s]."""
    radius: float
    """Of the robot [m]."""
    goal: Goal | None = None
    """Drive there, and end; None: serve the goals of the topic until it is ended."""
    seconds: float | None = None
    """Give up after so long [s]."""
    record: str | None = None
    """Record to this name with .csv and .mcap put behind."""
    recorder: Callable[[Session, Path], Recorder] | None = None
    """Makes what writes the .mcap."""
    notes: tuple[str, ...] = ()
    """What a user should know before it drives."""


class Enabler:
    """Enables the robot again when a goal arrives after it was given back.

    A goal is as deliberate as the word of an operator; it never resets an emergency stop.

    Parameters
    ----------
    inputs : Inputs
        Count the goals.
    enable : callable
        Enables the gate.
    """

    def __init__(self, inputs: Inputs, enable: Callable[[], None]) -> None:
        self._inputs, self._enable = inputs, enable
        self._seen = inputs.goals

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Look for a new goal."""
        if self._inputs.goals == self._seen:
            return
        self._seen = self._inputs.goals
        if output.state in (GateState.RELEASED, GateState.IDLE):
            self._enable()


def run(
    driver: Ros2Driver,
    robot: Robot,
    navigator: GoalNavigator,
    errand: Errand,
    out: TextIO | None,
) -> tuple[dict[str, Any], int]:
    """Serve goals; return the report and the exit status.

    Parameters
    ----------
    driver : Ros2Driver
        Not yet connected.
    robot : Robot
        Its limits and its patience.
    navigator : GoalNavigator
        Plans.
    errand : Errand
        Where to, and for how long.
    out : text stream, optional
        For people; nothing is written if not given.
    """

    def controller(state: State) -> VelocityCommand:
        return navigator(state, session.planner.held)

    with Session(
        robot,
        controller,
        errand.period,
        output=None if errand.record is None else Path(errand.record),
        out=out,
        driver=driver,
        observers=(Enabler(driver.inputs, lambda: session.gate.enable()),),
        warnings=lambda: (*driver.warnings(), *telling.warnings()),
        record=None if errand.record is None else errand.recorder,
    ) as session:
        sys.stderr.write("".join(f"kmpc: {note}\n" for note in errand.notes))
        if errand.goal is not None:
            driver.inputs.drive_to(errand.goal)
        telling = Telling(driver, navigator, session.loop, errand.radius)
        began = time.monotonic()
        given_back: list[str] = []

        def finished() -> bool:
            late = errand.seconds is not None and time.monotonic() - began > errand.seconds
            if late and session.gate.state is GateState.RELEASED:
                given_back[:] = ["the robot was given back: a new goal lets it drive again"]
            return late or (errand.goal is not None and navigator.reached > 0)

        telling.start()
        try:
            session.drive(finished)
        finally:
            telling.stop()
        interrupted = session.loop.stop_reason in SIGNALS
        report = {
            **_ending(navigator, session, given_back),
            "clock_offset_s": driver.inputs.clock_offset(time.monotonic()),
            **navigator.report(),
            **session.report(),
        }
        session.logs.finish(report)
    report["problems"] = session.problems()
    if out is not None:
        _tell(report, session, out)
    if navigator.reached or (errand.goal is None and not interrupted):
        return report, DONE
    return report, INTERRUPTED if interrupted else NOT_DONE


def _ending(navigator: GoalNavigator, session: Session, more: list[str]) -> dict[str, Any]:
    """How the drives ended, as `kmpc run` says it: `outcome`, `why`, and both in `ended`."""
    if navigator.arrived:
        return {"outcome": "arrived", "ended": "", "why": []}
    stop, drove = session.loop.stop_reason, session.loop.drove_from is not None
    outcome = "time is up" if navigator.started and drove else "never drove"
    if stop in SIGNALS:
        outcome = f"stopped by {stop}"
    controller = f"the controller: {navigator.reason}" if navigator.reason else ""
    why = [*told_once(session.loop.why_stopped, session.words()), *more]
    why += filter(None, (controller,))
    ended = ended_words(outcome, navigator.duration(), navigator.errors(), "", why)
    return {"outcome": outcome, "ended": ended, "why": why}


def _tell(report: dict[str, Any], session: Session, out: TextIO) -> None:
    """Summary for people."""
    counts = report["statuses"].items()
    lines = [
        "",
        f"{report['outcome']}: {report['goals_reached']} of {report['goals_begun']} goals reached",
        f"plans: {', '.join(f'{name} {count}' for name, count in counts) or 'none'}",
        "",
        table(session.loop.histograms()),
        *([f"why: {report['ended']}"] if report["ended"] else []),
        *report["problems"],
    ]
    out.write("\n".join(lines) + "\n")
