"""The control loop on the robot: at absolute deadlines it reads the state, asks the gate, sends."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import LinkStatus, State
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.timing import Deadlines, Histogram
from firmware_bridge.safety.gate import GateOutput, SafetyGate
from firmware_bridge.safety.gate_table import Action, GateState, Reason

TICK = 0.02
"""Period of the gate [s]: a lost input is noticed at most this much late, and stops are sent this
often."""
GIVE_UP = 2.0
"""How long after the ramp and the hold a board may take to obey the release [s]."""
LATE_PLAN = 1.5
"""After this many periods a command is sent again although no new plan has come."""
DEAD = LinkStatus(connected=False, heartbeat_stamp=-math.inf, pose_stamp=-math.inf, ready=False)
"""Status of a driver that raises."""


class Observer(Protocol):
    """Sees each tick, as a recorder does; must return at once."""

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in what was done at `now` [s].

        `sent` tells whether v and omega went on the wire, `fresh` whether a plan went out for the
        first time.
        """
        ...


class Operator(Protocol):
    """Gives the requests of people: see estop.py."""

    def take(self) -> set[str]:
        """Give the requests since the last call: any of stop, reset, enable, confirm."""
        ...

    def tell(self, state: GateState, why: tuple[str, ...], barred: str) -> None:
        """Learn what the gate is doing, what is wrong, and why `enable` would be refused."""
        ...


@dataclass(frozen=True)
class Change:
    """The gate went from one state to another."""

    time: float
    """Since the start of the loop [s]."""
    before: GateState
    after: GateState
    why: tuple[str, ...]
    """What was wrong then."""


@dataclass(frozen=True)
class Snapshot:
    """What the loop did last, for displays in other threads."""

    now: float
    state: State | None
    status: LinkStatus
    output: GateOutput


@dataclass
class Statistics:
    """Counts of a drive; their memory does not grow."""

    ticks: int = 0
    skipped: int = 0
    """Ticks left out after a stall."""
    sent: int = 0
    refused: int = 0
    """Commands that the driver would not take."""
    driver_errors: int = 0
    last_error: str = ""
    reasons: Counter[str] = field(default_factory=Counter)
    """Number of ticks at which each reason held."""
    late: Histogram = field(default_factory=Histogram)
    work: Histogram = field(default_factory=Histogram)
    pose_to_wire: Histogram = field(default_factory=Histogram)
    spacing_error: Histogram = field(default_factory=Histogram)


class ControlLoop:
    """Moves commands from the planner through the gate to the driver.

    Parameters
    ----------
    driver : Driver
        Connected.
    gate : SafetyGate
        Every command passes it.
    planner : Planner
        Asked in its own thread; `run` starts it.
    command_period : float
        While driving, commands go out this far apart [s]; whatever stops the robot goes out at
        every tick.
    tick : float
        Period of the gate [s].
    observers : sequence of Observer
        Called at each tick.
    operator : Operator, optional
        Emergency stop, reset, enable.
    take : callable, optional
        Asks the board for control again, where the operator enables the robot after it was given
        back or taken.
    confirm : callable, optional
        Tells the driver that the board's frame was looked at.
    clock, sleep : callable
        For tests.
    """

    def __init__(
        self,
        driver: Driver,
        gate: SafetyGate,
        planner: Planner,
        *,
        command_period: float = TICK,
        tick: float = TICK,
        observers: tuple[Observer, ...] = (),
        operator: Operator | None = None,
        take: Callable[[], None] | None = None,
        confirm: Callable[[], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.driver, self.gate, self.planner = driver, gate, planner
        self._command_period, self._tick, self._observers, self._operator = (
            command_period,
            tick,
            observers,
            operator,
        )
        self._take, self._confirm, self._clock, self._sleep = take, confirm, clock, sleep
        self.statistics = Statistics()
        self.changes: deque[Change] = deque(maxlen=1000)
        """The gate's last changes of state."""
        self.changes_total = 0
        """Number of all changes."""
        self.snapshot: Snapshot | None = None
        self.stop_reason = ""
        """Why the loop ends, once it does."""
        self._abort = False
        self.started = clock()
        """When the loop began [s]."""
        self._last_sent = -math.inf
        self._last_plan: object = None
        """Newest plan that was sent, or that was there while none was asked for."""
        self._last_pose: float | None = None

    def request_stop(self, why: str) -> None:
        """Brake, hold, release and end; asked again, zero and release at once. Signal-safe."""
        if self.stop_reason:
            self._abort = True
        else:
            self.stop_reason = why

    def tick(self, now: float) -> GateOutput:
        """Do one period's work; never raises."""
        state, status = self._read()
        self._take_requests(status)
        latest, before = self.planner.latest, self.gate.state
        output = self.gate.step(now, None if latest is None else latest[0], state, status)
        counts = self.statistics
        counts.ticks += 1
        for reason in output.reasons:
            counts.reasons[reason.value] += 1
        sent = self._do(now, output, latest)
        fresh = sent and output.state is GateState.ACTIVE and latest is not self._last_plan
        if sent or output.state is not GateState.ACTIVE:
            self._last_plan = latest
        if (
            sent
            and output.state is GateState.ACTIVE
            and latest is not None
            and latest[1] != self._last_pose
        ):
            self._last_pose = latest[1]
            counts.pose_to_wire.add(self._clock() - latest[1])
        if output.state is not before:
            self.changes.append(
                Change(
                    now - self.started,
                    before,
                    output.state,
                    tuple(r.value for r in output.reasons),
                )
            )
            self.changes_total += 1
        self.snapshot = Snapshot(now, state, status, output)
        for observer in self._observers:
            try:
                observer.on_tick(now, state, output, sent, fresh)
            except Exception as error:  # a log must not stop a robot
                self._note(error)
        return output

    def run(self, finished: Callable[[], bool] | None = None) -> None:
        """Drive until asked to stop, or until `finished` says so; then brake, hold and release.

        Whatever ends it, the last thing on the wire is a stop.
        """
        self.started = self._clock()
        self.planner.start()
        deadlines, stopping_since = Deadlines(self._tick, self.started), None
        try:
            while True:
                deadline = deadlines.next
                pause = deadline - self._clock()
                if pause > 0.0:
                    self._sleep(pause)
                now = self._clock()
                self.statistics.late.add(max(0.0, now - deadline))
                if self.stop_reason == "" and finished is not None and finished():
                    self.request_stop("finished")
                if self.stop_reason and stopping_since is None:
                    stopping_since = now
                    self.gate.stop()
                self.tick(now)
                after = self._clock()
                self.statistics.work.add(after - now)
                deadlines.advance(after)
                self.statistics.skipped = deadlines.skipped
                if self._abort or (
                    stopping_since is not None
                    and (self.gate.done or now - stopping_since > self._patience())
                ):
                    return
        finally:
            self.planner.stop()
            if not self.gate.done:
                self._guarded(self.driver.stop)

    def _patience(self) -> float:
        limits = self.gate.settings.limits
        ramp = (
            max(limits.v_max, limits.v_reverse) / limits.deceleration
            + limits.omega_max / limits.angular_deceleration
        )
        return ramp + self.gate.settings.hold + GIVE_UP

    def _read(self) -> tuple[State | None, LinkStatus]:
        try:
            return self.driver.state(), self.driver.health()
        except Exception as error:  # a driver that fails is a link that is down
            self._note(error)
            return None, DEAD

    def _take_requests(self, status: LinkStatus) -> None:
        if self._operator is None:
            return
        self._operator.tell(self.gate.state, self.why(), _barred(status))
        for request in self._operator.take():
            if request == "confirm":
                if self._confirm is not None:
                    self._guarded(self._confirm)
                continue
            if request == "enable" and status.frame_doubt:
                continue
            if (
                request == "enable"
                and self._take is not None
                and self.gate.state in (GateState.RELEASED, GateState.YIELDED, GateState.IDLE)
            ):
                self._guarded(self._take)
            {"stop": self.gate.estop, "reset": self.gate.reset, "enable": self.gate.enable}[
                request
            ]()

    def why(self) -> tuple[str, ...]:
        """Why the robot does not drive, in words: the gate's reasons, then the board's own."""
        shot = self.snapshot
        if shot is None:
            return ()
        reasons = (reason.value for reason in shot.output.reasons if reason is not Reason.BOARD)
        more = (*shot.status.faults, *shot.status.scan_faults, shot.status.frame_doubt)
        return (*reasons, *filter(None, more))

    def _do(self, now: float, output: GateOutput, latest: object) -> bool:
        """Carry out what the gate decided; return whether v and omega went out."""
        if output.action is Action.RELEASE:
            self.planner.sent.add(now, 0.0, 0.0)
            self._guarded(self.driver.stop)
            return False
        if output.action is Action.NOTHING:
            return False
        if output.state is GateState.ACTIVE and not self._due(now, latest):
            return False
        if not self._guarded(lambda: self.driver.send(output.v, output.omega)):
            self.statistics.refused += 1
            return False
        if output.state is GateState.ACTIVE and math.isfinite(self._last_sent):
            self.statistics.spacing_error.add(
                abs(now - self._last_sent - max(self._tick, self._command_period))
            )
        self._last_sent = now
        self.statistics.sent += 1
        self.planner.sent.add(now, output.v, output.omega)
        return True

    def _due(self, now: float, latest: object) -> bool:
        """Whether to send while driving: once a period, or with each plan where plans are rare."""
        elapsed = now - self._last_sent
        if (
            self._command_period > 1.5 * self._tick
            and abs(self._command_period - self.planner.period) < 0.5 * self._tick
        ):
            return latest is not self._last_plan or elapsed >= LATE_PLAN * self._command_period
        return elapsed >= self._command_period - 0.5 * self._tick

    def _guarded(self, action: Callable[[], None]) -> bool:
        try:
            action()
        except Exception as error:  # no exception of a driver leaves the loop
            self._note(error)
            return False
        return True

    def _note(self, error: Exception) -> None:
        self.statistics.driver_errors += 1
        self.statistics.last_error = f"{type(error).__name__}: {error}"

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON: counts and times in milliseconds."""
        counts = self.statistics
        return {
            "ticks": counts.ticks,
            "ticks_skipped": counts.skipped,
            "commands_sent": counts.sent,
            "commands_refused": counts.refused,
            "controller_errors": self.planner.errors,
            "controller_periods_skipped": self.planner.skipped,
            "errors": counts.driver_errors,
            "last_error": counts.last_error or self.planner.last_error,
            "stop_reason": self.stop_reason,
            "reasons": {reason: count for reason, count in counts.reasons.items()},
            "changes": [
                {
                    "time": round(c.time, 3),
                    "from": c.before.name,
                    "to": c.after.name,
                    "why": list(c.why),
                }
                for c in list(self.changes)[-100:]
            ],
            "times_ms": {name: times.summary() for name, times in self.histograms().items()},
        }

    def histograms(self) -> dict[str, Histogram]:
        """Histograms of times, by name."""
        counts = self.statistics
        return {
            "pose age when planning": self.planner.pose_age,
            "controller": self.planner.step_time,
            "pose to command on the wire": counts.pose_to_wire,
            "gate period, late by": counts.late,
            "gate and driver, work": counts.work,
            "command spacing, off by": counts.spacing_error,
        }


def _barred(status: LinkStatus) -> str:
    """Why the robot may not be enabled, empty where it may."""
    if not status.frame_doubt:
        return ""
    return (
        f"{status.frame_doubt}: its frame may lie elsewhere; look where the robot is shown, then "
        "kmpc estop --confirm-frame"
    )
