"""The control loop on the robot: at absolute deadlines it reads the state, asks the gate, sends."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import STILL, LinkStatus, State
from firmware_bridge.runtime.command_sender import CommandSender
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.observer import Change, Observer, Operator, Snapshot
from firmware_bridge.runtime.requests import Requests
from firmware_bridge.runtime.statistics import Statistics
from firmware_bridge.runtime.timing import Deadlines, Histogram, Suspension
from firmware_bridge.safety.gate import GateOutput, SafetyGate
from firmware_bridge.safety.gate_settings import TICK
from firmware_bridge.safety.gate_table import GateState, Reason
from firmware_bridge.safety.unmoved import Unmoved, UnmovedOptions

FINISHED = "finished"  # why a drive is stopped that has come to its end
GIVE_UP = 2.0  # how long after the ramp and the hold a board may take to obey the release [s]
DEAD = LinkStatus(connected=False, heartbeat_stamp=-math.inf, pose_stamp=-math.inf, ready=False)
"""Status of a driver that raises."""


class ControlLoop:
    """Moves commands from the planner through the gate to the driver.

    `driver`: connected. `gate`: every command passes it. `planner`: asked in its own thread; `run`
    starts it. `command_period`: while driving, commands go out this far apart [s]; whatever stops
    the robot goes out at every tick. `tick`: period of the gate [s]. `observers`: called at each
    tick. `operator`: emergency stop, reset, enable. `take`: asks the board for control again, where
    the operator enables the robot after it was given back or taken. `confirm`: tells the driver
    that the board's frame was looked at. `clock`, `sleep`: for tests.
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
        self._tick, self._observers, self._clock, self._sleep = tick, observers, clock, sleep
        self._sender = CommandSender(driver, planner, command_period, tick, clock)
        self._requests = Requests(operator, gate, take, confirm)
        self._unmoved = Unmoved(UnmovedOptions(patience=gate.settings.unmoved))
        self._held, self._suspension = STILL, Suspension()
        self.statistics = Statistics()
        self.changes: deque[Change] = deque(maxlen=1000)  # the gate's last changes of state
        self.changes_total = 0  # number of all changes
        self.snapshot: Snapshot | None = None
        self.stop_reason = ""  # why the loop ends, once it does
        self.why_stopped: tuple[str, ...] = ()
        """What was wrong when it was asked to end: afterwards it is given back, and not ready."""
        self._abort = False
        self._started = clock()
        self.drove_from: float | None = None  # when the gate first let commands pass [s]

    @property
    def began(self) -> float:
        """When the time of a drive begins, wherever it is shown [s].

        That is `drove_from`, and until then the beginning of the loop.
        """
        return self._started if self.drove_from is None else self.drove_from

    def request_stop(self, why: str) -> None:
        """Brake, hold, release and end; asked again, zero and release at once. Signal-safe."""
        if self.stop_reason:
            self._abort = True
        else:
            self.stop_reason = why

    def tick(self, now: float) -> GateOutput:
        """Do one period's work; never raises."""
        state, status = self._read()
        if unmoved := self._unmoved.look(self.gate.state, now, self._held, state):
            status = replace(status, unmoved=unmoved)
        if self._suspension.happened():
            self.gate.slept()
        counts = self.statistics
        self._requests.pass_on(status, self.why, counts)
        latest, before = self.planner.latest, self.gate.state
        output = self.gate.step(now, None if latest is None else latest[0], state, status)
        self._held = output.speeds
        counts.ticks += 1
        counts.reasons.update(reason.value for reason in output.reasons)
        sent, fresh = self._sender.carry_out(now, output, latest, counts)
        if output.state is not before:
            why = tuple(reason.value for reason in output.reasons)
            if output.state is GateState.ACTIVE and self.drove_from is None:
                self.drove_from = now
            self.changes.append(Change(now, before, output.state, why))
            self.changes_total += 1
        self.snapshot = Snapshot(now, state, status, output)
        for observer in self._observers:
            # a log must not stop a robot
            counts.guarded(partial(observer.on_tick, now, state, output, sent, fresh))
        return output

    def run(self, finished: Callable[[], bool] | None = None) -> None:
        """Drive until asked to stop, or until `finished` says so; then brake, hold and release.

        Whatever ends it, the last thing on the wire is a stop.
        """
        self._started = self._clock()
        self.planner.start()
        deadlines, stopping_since = Deadlines(self._tick, self._started), None
        try:
            while True:
                deadline = deadlines.next
                pause = deadline - self._clock()
                if pause > 0.0:
                    self._sleep(pause)
                now = self._clock()
                self.statistics.late.add(max(0.0, now - deadline))
                if self.stop_reason == "" and finished is not None and finished():
                    self.request_stop(FINISHED)
                if self.stop_reason and stopping_since is None:
                    stopping_since, self.why_stopped = now, self.why()
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
                self.statistics.guarded(self.driver.stop)

    def _patience(self) -> float:
        limits = self.gate.settings.limits
        ramp = (
            max(limits.v_max, limits.v_reverse, limits.sideways) / limits.deceleration
            + limits.omega_max / limits.angular_deceleration
        )
        return ramp + self.gate.settings.hold + GIVE_UP

    def _read(self) -> tuple[State | None, LinkStatus]:
        try:
            return self.driver.state(), self.driver.health()
        except Exception as error:  # a driver that fails is a link that is down
            self.statistics.note(error)
            return None, DEAD

    def why(self) -> tuple[str, ...]:
        """Why the robot does not drive, in words: the gate's reasons, then the board's own."""
        shot = self.snapshot
        if shot is None:
            return ()
        reasons = (reason.value for reason in shot.output.reasons if reason is not Reason.BOARD)
        more = (
            *shot.status.faults,
            *shot.status.scan_faults,
            shot.status.frame_doubt,
            shot.status.unmoved,
        )
        return (*reasons, *filter(None, more))

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON: counts and times in milliseconds."""
        changes = [(change.time - self.began, change) for change in self.changes]
        return self.statistics.report(self.planner, self.stop_reason, changes)

    def histograms(self) -> dict[str, Histogram]:
        """Histograms of times, by name."""
        return self.statistics.histograms(self.planner)
