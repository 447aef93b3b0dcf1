"""What `kmpc record` does with a session, and its report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TextIO

from firmware_bridge.messages import ConfigError, State, VelocityCommand
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.recording.watch import Command, DriveWatch
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.drive import DONE, INTERRUPTED, NOT_DONE, SIGNALS
from firmware_bridge.runtime.session import Session
from firmware_bridge.safety.gate_table import GateState

METER_PERIOD = 1.0  # period of the reports on what the log shows so far [s]
BAR = 10  # length of a part's bar, in characters


@dataclass(frozen=True)
class RandomDriving:
    """How a robot is driven at random."""

    hold: float | None = None  # how long a command is held [s]; None: it follows from the robot
    seed: int = 0
    until_covered: bool = False  # whether it ends as soon as the log shows all that a model needs


class Covered(Protocol):
    """What a log shows: kmpc_lite's `Coverage`."""

    @property
    def is_complete(self) -> bool:
        """Whether nothing is missing."""

    def as_dict(self) -> Mapping[str, float]:
        """Share of each part."""

    def advice(self) -> Sequence[str]:
        """What is missing, and how it is recorded."""


Meter = Callable[[list[list[Command]], tuple[float, float, float] | None], Covered]
"""Commands of each stretch, and the speeds that are driven, if these are known -> what they show.
"""


def record(
    robot: Robot,
    output: str,
    seconds: float,
    *,
    period: float,
    excitation: RandomDriving | None,
    out: TextIO | None,
    meter: Meter | None = None,
    wait: float | None = None,
) -> tuple[dict[str, Any], int]:
    """Record a drive to learn from; return the report and the exit status.

    `robot`: what to drive, or to listen to. `output`: name of the files. `seconds`: for how long,
    from the first moment in which it counts [s]. `period`: of the rows, and of the random driving
    [s]. `excitation`: how it is driven at random; None: a pilot drives by hand. `out`: for people.
    `meter`: tells what the log shows. `wait`: how long the vehicle may take until it is driven at
    random [s]; `seconds` if not given.
    """
    drive = Recording(robot, seconds, period, excitation, meter, wait=wait)
    with Session(
        robot,
        drive.control,
        period,
        output=Path(output),
        by_hand=excitation is None,
        out=out,
        observers=(drive.watch,),
        more=drive.lines,
    ) as session:
        if out is not None and drive.note:
            out.write(f"{drive.note}\n")
        session.drive(lambda: drive.finished(session))
        report = {"outcome": drive.outcome, **session.report()}
        interrupted = session.loop.stop_reason in SIGNALS
    # counted after the session has closed its files
    report["rows"], report["problems"] = session.logs.rows, (problems := session.problems())
    report |= drive.report()
    if out is not None:
        out.write(f"{session.logs.rows} rows every {period:g} s in {', '.join(report['files'])}\n")
        out.write("".join(f"{line}\n" for line in (*problems, *drive.summary())))
    if not session.logs.rows or problems or drive.trouble:
        return report, NOT_DONE
    return report, INTERRUPTED if interrupted and not session.logs.rows else DONE


class Recording:
    """One recording: driver, end, coverage.

    `robot`, `seconds`, `period`, `driving`, `meter`, `wait`: see `record`. `clock`: [s].
    """

    def __init__(
        self,
        robot: Robot,
        seconds: float,
        period: float,
        driving: RandomDriving | None,
        meter: Meter | None,
        clock: Callable[[], float] = time.monotonic,
        wait: float | None = None,
    ) -> None:
        self._clock, self._wait = clock, seconds if wait is None else wait
        self._started: float | None = None
        limits = robot.gate.limits
        self.watch = DriveWatch(period, limits, by_hand=driving is None)
        self._seconds, self._driving, self._meter = seconds, driving, meter
        self._excitation: Excitation | None = None
        if driving is not None:
            self._excitation = Excitation(
                _fence(robot),
                limits,
                driving.hold,
                seconds,
                driving.seed,
                lambda: self.watch.delay,
                wheels=robot.wheels,
            )
        self._began: float | None = None
        self._measured = 0.0
        self._coverage: Covered | None = None
        self.trouble = ""  # why it was ended before its time

    @property
    def note(self) -> str:
        """What a user should know before it drives."""
        return "" if self._excitation is None else self._excitation.note

    def control(self, state: State) -> VelocityCommand:
        """Give the command for now; if a pilot drives by hand the gate passes none."""
        if state.stamp - self._measured >= METER_PERIOD:
            self._measured = state.stamp
            self._look()
        if self._excitation is None:
            return VelocityCommand(0.0, 0.0, state.stamp)
        return self._excitation(state)

    def _look(self) -> None:
        """Measure what the log shows."""
        if self._meter is not None:
            stretches = [list(stretch) for stretch in self.watch.stretches]
            largest = None if self._excitation is None else self._excitation.largest[:3]
            self._coverage = self._meter(stretches, largest)

    def finished(self, session: Session) -> bool:
        """Whether it is over; a robot that does not follow its commands is stopped."""
        state = session.gate.state
        if self._began is None:
            if self._driving is not None and state is not GateState.ACTIVE:
                self._wait_for(session)
                return False
            self._began = self._clock()
        if self._excitation is not None and not session.loop.stop_reason:
            given_back = state is GateState.RELEASED
            lost = f"the robot was given back: {_last_fault(session)}" if given_back else ""
            self.trouble = self.watch.trouble or self._excitation.trouble or lost
            if self.trouble:
                session.loop.request_stop(self.trouble)
                return False
        return self._is_covered or self._clock() - self._began > self._seconds

    def _wait_for(self, session: Session) -> None:
        """Give up, and say why, where the vehicle has not let itself be driven in time."""
        now = self._clock()
        if self._started is None:
            self._started = now
        if now - self._started > self._wait and not session.loop.stop_reason:
            why = "; ".join(session.why()) or "it was not given to the bridge"
            self.trouble = f"never drove within {self._wait:g} s: {why}"
            session.loop.request_stop(self.trouble)

    @property
    def _is_covered(self) -> bool:
        wanted = self._driving is not None and self._driving.until_covered
        return wanted and self._coverage is not None and self._coverage.is_complete

    @property
    def outcome(self) -> str:
        """How it ended, in words."""
        if self.trouble:
            return f"stopped: {self.trouble}"
        if self._began is None:
            return "never drove"
        return "covered" if self._is_covered else "recorded"

    def lines(self) -> list[str]:
        """What the log shows so far, for a terminal."""
        if self._coverage is None:
            return []
        parts = [
            f"{name:<14} {'#' * round(BAR * share):.<{BAR}}"
            for name, share in self._coverage.as_dict().items()
        ]
        return [f"coverage    {'   '.join(parts[k : k + 4])}" for k in range(0, len(parts), 4)]

    def report(self) -> dict[str, Any]:
        """What the drive has shown, for JSON."""
        self._look()
        delay = self.watch.delay
        report: dict[str, Any] = {"delay_s": None if delay is None else round(delay, 3)}
        if self._coverage is not None:
            report["coverage"] = {
                "complete": self._coverage.is_complete,
                "parts": dict(self._coverage.as_dict()),
                "missing": list(self._coverage.advice()),
            }
        return report

    def summary(self) -> list[str]:
        """What the drive has shown, for people."""
        lines = [f"stopped: {self.trouble}"] if self.trouble else []
        if self._began is None:
            return lines or ["never drove"]
        if self._coverage is None:
            return lines
        if self._coverage.is_complete:
            return [*lines, "the log shows all that a model needs"]
        return [
            *lines,
            "the log shows too little of this; record it too, and give both logs to kmpc fit:",
            *(f"  {line}" for line in self._coverage.advice()),
        ]


def _last_fault(session: Session) -> str:
    """Why the robot was braked last, in words."""
    why = [change.why for change in session.loop.changes if change.why]
    return ", ".join(why[-1]) if why else "reason unknown"


def _fence(robot: Robot) -> tuple[float, float, float, float]:
    if robot.gate.geofence is None:
        raise ConfigError(
            f"{robot.where}: safety.geofence: missing: random driving needs [xmin, ymin, xmax, "
            "ymax] (--geofence), free of obstacles"
        )
    return robot.gate.geofence
