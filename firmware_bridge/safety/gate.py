"""The safety gate, through which every command passes.

It is a pure state machine on the times that it is given: no thread, no clock, no link. Its
transitions are the table in gate_table.py, from which docs/howto/bridge.md and the tests are made
too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmware_bridge.messages import STILL, LinkStatus, Speeds, State, VelocityCommand
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import (
    BY_STATE,
    DRIVING,
    FINAL,
    REQUESTS,
    UNHEARD,
    Action,
    Event,
    GateState,
    LostPose,
    Reason,
    Slowing,
    judge,
)

LONGEST_RISE = 0.05
"""Longest time for which a command may grow in one step, however long the last step is ago [s]; it
shrinks for the whole time, or a machine that stalls would brake late."""
LONGEST_STALL = 1.0
"""A gate that stood still for longer than this, and than `hold`, does not let the robot drive on by
itself: the world is another one by then [s]."""
RESEND = 0.5  # how often the release is sent again until the board has obeyed [s]


@dataclass(frozen=True)
class GateOutput:
    """What to do now."""

    v: float  # [m/s]
    omega: float  # [rad/s]
    action: Action
    state: GateState
    reasons: tuple[Reason, ...]  # what is wrong now, whatever the state
    vy: float = 0.0  # of an omni, to the left [m/s]

    @property
    def speeds(self) -> Speeds:
        """All of them."""
        return self.v, self.omega, self.vy


class SafetyGate:
    """Decides, step by step, what reaches the motors.

    `enable`, `stop`, `estop` and `reset` are remembered and take effect in the next `step`. All in
    one thread.

    `settings`: limits and patience. `late_after`: age at which a controller's output is late, if
    later than the settings say [s]: outputs of a slow controller are old before the next one comes.

    Examples
    --------
    >>> gate = SafetyGate()
    >>> gate.step(0.0, None, None, LinkStatus(False, -math.inf, -math.inf, ready=False)).action.name
    'NOTHING'
    """

    def __init__(
        self, settings: GateSettings | None = None, late_after: float | None = None
    ) -> None:
        self.settings = GateSettings() if settings is None else settings
        self._slowing = Slowing(self.settings, late_after)
        self._lost_pose = LostPose(self.settings)
        self.state = GateState.IDLE
        self._requests: set[Event] = set()
        self._output = STILL
        self._final = self._slept = False
        self._last: float | None = None
        self._entered = -math.inf
        self._clear_since: float | None = None
        self._released_at: float | None = None
        self._acknowledged = False

    def enable(self) -> None:
        """Let the robot drive once nothing is wrong, after a release, take-over or reset too."""
        self._requests.add(Event.ENABLE)

    def stop(self) -> None:
        """Ramp to zero, hold, release."""
        self._requests.add(Event.STOP)

    def estop(self) -> None:
        """Zero at once, and nothing else until `reset`."""
        self._requests.add(Event.ESTOP)

    def reset(self) -> None:
        """Clear the emergency stop; the robot stays still until `enable`."""
        self._requests.add(Event.RESET)

    def slept(self) -> None:
        """Take note that the computer was asleep, in which its clock did not go on."""
        self._slept = True

    @property
    def done(self) -> bool:
        """Whether the gate has no more to send: it is not driving, and a release was obeyed."""
        return self.state in (GateState.IDLE, GateState.YIELDED) or (
            self.state in (GateState.RELEASED, GateState.ESTOP) and self._acknowledged
        )

    def step(
        self, now: float, command: VelocityCommand | None, state: State | None, status: LinkStatus
    ) -> GateOutput:
        """Judge the inputs and give what is to be sent now.

        `now`: `time.monotonic()`, or any clock that the stamps share [s]. `command`: newest output
        of the controller. `state`: newest pose. `status`: newest status of the link and the board.
        """
        dt = 0.0 if self._last is None else max(now - self._last, 0.0)
        self._last = now
        reasons = judge(self.settings, now, command, state, status, self.state)
        if self._slept or dt > max(self.settings.hold, LONGEST_STALL):
            reasons = (*reasons, Reason.STALLED)
        self._slept = False
        if reasons:
            self._clear_since = None
            self._final = self._final or (self.state in DRIVING and not FINAL.isdisjoint(reasons))
        elif self._clear_since is None:
            self._clear_since = now
        if self._lost_pose.strayed(self.state, state, status, reasons):
            self._final = True
        # an emergency stop beats whatever is asked for in the same step
        events = {Event.ESTOP} if Event.ESTOP in self._requests else set(self._requests)
        self._requests.clear()
        if reasons:
            events.add(Event.FAULT)
        if self.settings.pilot and Reason.NOT_READY in reasons and UNHEARD.isdisjoint(reasons):
            events.add(Event.TAKEN)
        # several transitions may fall into one step: a stop asked of a robot that stands, and that
        # a pilot has taken
        while (then := self._next(now, events)) is not None:
            self._enter(then, now)
        return self._act(now, dt, command, state, status, reasons)

    def _next(self, now: float, events: set[Event]) -> GateState | None:
        """The state that the table gives for these events; None: no change."""
        for transition in BY_STATE[self.state]:
            event = transition.event
            if event is Event.CLEAR:
                happened = (
                    self._clear_since is not None
                    and now - self._clear_since >= self.settings.settle
                    and not self._final
                )
            elif event is Event.STILL:
                happened = self._output == STILL
            elif event is Event.HELD:
                waited = now - self._entered
                # inputs that are good again get `settle` to prove it before the robot is given back
                proving = self._clear_since is not None and not self._final
                happened = waited >= self._lost_pose.patience(self._final) and not proving
            else:
                happened = event in events
            if happened:
                if event in REQUESTS:
                    events.discard(event)
                self._final = (self._final or event is Event.STOP) and event is not Event.ENABLE
                return transition.then
        return None

    def _enter(self, state: GateState, now: float) -> None:
        self.state, self._entered = state, now
        self._released_at, self._acknowledged = None, False

    def _act(
        self,
        now: float,
        dt: float,
        command: VelocityCommand | None,
        state: State | None,
        status: LinkStatus,
        reasons: tuple[Reason, ...],
    ) -> GateOutput:
        """Output of the present state."""
        limits, action, output = self.settings.limits, Action.SEND, STILL
        if self.state is GateState.ACTIVE:
            assert command is not None
            share = self._slowing.share(now, command, state, status)
            wanted = limits.clip(command.speeds, share)
            output = limits.slew(self._output, wanted, dt, LONGEST_RISE)
        elif self.state is GateState.STOPPING:
            output = limits.slew(self._output, STILL, dt)
        elif self.state is GateState.WAITING:
            # zeros feed the watchdog of a board that would trip on silence, and take back motors
            # that were released
            if (self.settings.pilot and Reason.NOT_READY in reasons) or not UNHEARD.isdisjoint(
                reasons
            ):
                action = Action.NOTHING
        elif self.state in (GateState.RELEASED, GateState.ESTOP):
            action = self._release(now, status, reasons)
        elif self.state is not GateState.HOLDING:
            action = Action.NOTHING
        self._output = output
        v, omega, vy = output
        return GateOutput(v, omega, action, self.state, reasons, vy)

    def _release(self, now: float, status: LinkStatus, reasons: tuple[Reason, ...]) -> Action:
        """Give the robot back until the board has obeyed.

        A plain motor controller has obeyed when it is heard again.
        """
        latched = self.state is GateState.ESTOP
        heard = UNHEARD.isdisjoint(reasons)
        pilot = self.settings.pilot
        if self._released_at is not None and heard and status.heartbeat_stamp > self._released_at:
            # after a plain release a pilot may drive the robot; after an emergency stop nobody may
            self._acknowledged = (
                not pilot or not status.ready or (self._acknowledged and not latched)
            )
        if self._acknowledged:
            return Action.NOTHING
        # released motors coast: without an autopilot's HOLD the robot is braked first
        brake_first = latched and not pilot and now - self._entered < self.settings.hold
        if not brake_first and (self._released_at is None or now - self._released_at >= RESEND):
            self._released_at = now
            return Action.RELEASE
        return Action.SEND if latched and (brake_first or pilot or not heard) else Action.NOTHING
