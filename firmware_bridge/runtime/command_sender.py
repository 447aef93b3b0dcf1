"""Carries out what the gate decides: commands go to the driver when they are due, stops at once."""

from __future__ import annotations

import math
from collections.abc import Callable

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import VelocityCommand
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.statistics import Statistics
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState

LATE_PLAN = 1.5  # after this many periods a command is sent again although no new plan has come


class CommandSender:
    """Sends to one driver, and knows which plan has been sent.

    `driver`: connected. `planner`: the source of plans; it receives the commands sent.
    `command_period`: while driving, commands go out this far apart [s]; whatever stops the robot
    goes out at every tick. `tick`: period of the gate [s]. `clock`: gives the time [s].
    """

    def __init__(
        self,
        driver: Driver,
        planner: Planner,
        command_period: float,
        tick: float,
        clock: Callable[[], float],
    ) -> None:
        self._driver, self._planner, self._clock = driver, planner, clock
        self._period, self._tick = command_period, tick
        self._last_sent = -math.inf
        self._last_plan: object = None
        """Newest plan that was sent, or that was there while none was asked for."""
        self._last_pose: float | None = None

    def carry_out(
        self,
        now: float,
        output: GateOutput,
        latest: tuple[VelocityCommand, float] | None,
        counts: Statistics,
    ) -> tuple[bool, bool]:
        """Do what the gate decided for the planner's latest plan.

        Returns `sent`, `fresh`: whether speeds went on the wire, and whether a plan did for the
        first time.
        """
        drives = output.state is GateState.ACTIVE
        sent = self._send(now, output, latest, counts)
        fresh = sent and drives and latest is not self._last_plan
        if sent or not drives:
            self._last_plan = latest
        if sent and drives and latest is not None and latest[1] != self._last_pose:
            self._last_pose = latest[1]
            counts.pose_to_wire.add(self._clock() - latest[1])
        return sent, fresh

    def _send(self, now: float, output: GateOutput, latest: object, counts: Statistics) -> bool:
        """Tell the driver; return whether speeds went out."""
        if output.action is Action.RELEASE:
            self._planner.sent.add(now, 0.0, 0.0)
            counts.guarded(self._driver.stop)
            return False
        if output.action is Action.NOTHING:
            return False
        drives = output.state is GateState.ACTIVE
        if drives and not self._is_due(now, latest):
            return False
        if not counts.guarded(lambda: self._driver.send(*output.speeds)):
            counts.refused += 1
            return False
        if drives and math.isfinite(self._last_sent):
            usual = max(self._tick, self._period)
            counts.spacing_error.add(abs(now - self._last_sent - usual))
        self._last_sent = now
        counts.sent += 1
        self._planner.sent.add(now, *output.speeds)
        return True

    def _is_due(self, now: float, latest: object) -> bool:
        """Whether to send while driving: once a period, or with each plan where plans are rare."""
        elapsed = now - self._last_sent
        each_plan = abs(self._period - self._planner.period) < 0.5 * self._tick
        if self._period > 1.5 * self._tick and each_plan:
            return latest is not self._last_plan or elapsed >= LATE_PLAN * self._period
        return elapsed >= self._period - 0.5 * self._tick
