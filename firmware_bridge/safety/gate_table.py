"""States, events and transitions of the safety gate: one table for gate, docs and tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate_settings import GateSettings


class GateState(Enum):
    """What the gate is doing."""

    IDLE = "not enabled: nothing is sent"
    WAITING = (
        "enabled: waits until the board is ready and all inputs are good; "
        "zeros to a board that is ready"
    )
    ACTIVE = "commands pass, within limits"
    STOPPING = "a ramp to zero"
    HOLDING = "zeros"
    RELEASED = "given back: the board is told to hold; `kmpc estop --enable` drives on"
    YIELDED = "a pilot or another program has the robot; `kmpc estop --enable` takes it again"
    ESTOP = "latched emergency stop: zero, then released; `kmpc estop --reset`, then `--enable`"


class Event(Enum):
    """What moves the gate from one state to another."""

    ESTOP = "emergency stop pressed"
    RESET = "reset by the operator"
    ENABLE = "enabled by the operator"
    STOP = "stop requested (Ctrl-C, goal held)"
    TAKEN = "the autopilot is heard but does not obey any more: disarmed, or in another mode"
    FAULT = "something is missing, stale or wrong"
    STILL = "the command has come to zero"
    HELD = "zeros for as long as `hold`"
    CLEAR = "no fault for as long as `settle`, and no stop requested"


REQUESTS = frozenset({Event.ESTOP, Event.RESET, Event.ENABLE, Event.STOP})
"""Requests by people and programs; the transition that a request causes consumes it."""


class Action(Enum):
    """What to do with the gate's output."""

    NOTHING = "send nothing"
    SEND = "send v and omega"
    RELEASE = "zero, and give the robot back"


class Reason(Enum):
    """What is wrong with the gate's inputs."""

    LINK = "link down"
    HEARTBEAT = "board not heard"
    NOT_READY = "board not ready: not armed, not in the required mode, or not set up"
    BOARD = "board reports a fault"
    ESTIMATE = "board distrusts its own pose estimate"
    POSE = "no pose, or too old"
    POSE_INVALID = "pose not finite"
    FRAME = "the board's frame may have moved: look, then confirm it"
    RESTARTED = (
        "the board was restarted, and how far the robot rolled is not known: look, then enable"
    )
    UNMOVED = "commanded to drive, but the pose stays: frozen, an encoder dead, or motors off"
    STALLED = "the bridge itself was suspended, or the computer slept"
    SCAN = "no scan of the lidar, or too old"
    GEOFENCE = "outside the geofence"
    COMMAND = "no controller output, or too old"
    COMMAND_INVALID = "controller output not finite"


FINAL = frozenset({Reason.GEOFENCE, Reason.FRAME, Reason.RESTARTED, Reason.UNMOVED, Reason.STALLED})
"""Reasons that do not go away by themselves: such a stop ends in a release."""
UNHEARD = frozenset({Reason.LINK, Reason.HEARTBEAT})
"""Reasons that leave the state of the board unknown."""


@dataclass(frozen=True)
class Transition:
    """In `state`, when `event` happens, go to `then`."""

    state: GateState
    event: Event
    then: GateState


TRANSITIONS: tuple[Transition, ...] = (
    *(Transition(s, Event.ESTOP, GateState.ESTOP) for s in GateState if s is not GateState.ESTOP),
    Transition(GateState.ESTOP, Event.RESET, GateState.IDLE),
    Transition(GateState.IDLE, Event.ENABLE, GateState.WAITING),
    Transition(GateState.RELEASED, Event.ENABLE, GateState.WAITING),
    Transition(GateState.YIELDED, Event.ENABLE, GateState.WAITING),
    Transition(GateState.WAITING, Event.STOP, GateState.HOLDING),
    Transition(GateState.WAITING, Event.CLEAR, GateState.ACTIVE),
    Transition(GateState.ACTIVE, Event.TAKEN, GateState.YIELDED),
    Transition(GateState.ACTIVE, Event.STOP, GateState.STOPPING),
    Transition(GateState.ACTIVE, Event.FAULT, GateState.STOPPING),
    Transition(GateState.STOPPING, Event.TAKEN, GateState.YIELDED),
    Transition(GateState.STOPPING, Event.CLEAR, GateState.ACTIVE),
    Transition(GateState.STOPPING, Event.STILL, GateState.HOLDING),
    Transition(GateState.HOLDING, Event.TAKEN, GateState.YIELDED),
    Transition(GateState.HOLDING, Event.CLEAR, GateState.ACTIVE),
    Transition(GateState.HOLDING, Event.HELD, GateState.RELEASED),
)
"""The first match wins; what is not listed changes nothing."""
BY_STATE = {state: tuple(t for t in TRANSITIONS if t.state is state) for state in GateState}
"""Transitions out of each state, in order."""
DRIVING = frozenset({GateState.ACTIVE, GateState.STOPPING, GateState.HOLDING})
"""States in which the bridge controls the robot."""


def diagram() -> str:
    """Render the table as a Mermaid state diagram, for docs/howto/bridge.md."""
    lines = ["stateDiagram-v2", "    [*] --> IDLE"]
    for transition in TRANSITIONS:
        if transition.event is not Event.ESTOP:
            lines.append(
                f"    {transition.state.name} --> {transition.then.name}: {transition.event.name}"
            )
    lines += ["    note right of ESTOP: from every state, on ESTOP"]
    return "\n".join(lines)


def legend() -> str:
    """Render the states as a Markdown table, for docs/howto/bridge.md."""
    rows = (f"| {state.name} | {state.value} |" for state in GateState)
    return "\n".join(["| State | Meaning |", "|---|---|", *rows])


FUTURE = 0.05
"""How far a stamp may lie ahead of the time of a step [s], since another thread took it. A stamp
farther ahead is not trusted."""
GRACE = 1.5
"""Multiple of `pose_age` and `scan_age` at which a late pose or scan is a fault for a robot that
drives: from the age itself on it brakes, and past this it drives on only after `settle`."""


def judge(
    s: GateSettings,
    now: float,
    command: VelocityCommand | None,
    state: State | None,
    status: LinkStatus,
    gate: GateState,
) -> tuple[Reason, ...]:
    """Everything that is wrong with the inputs of a gate in a state."""
    found = []
    if not status.connected:
        found.append(Reason.LINK)
    if not fresh(now, status.heartbeat_stamp, s.heartbeat_age):
        found.append(Reason.HEARTBEAT)
    if not status.ready:
        found.append(Reason.NOT_READY)
    if status.faults:
        found.append(Reason.BOARD)
    if not status.pose_ok:
        found.append(Reason.ESTIMATE)
    # a robot that drives is slowed first, and braked past the limit: a gap is not yet a stop
    oldest = s.pose_age * (GRACE if gate is GateState.ACTIVE else 1.0)
    if state is None or not (
        fresh(now, state.stamp, oldest) and fresh(now, status.pose_stamp, oldest)
    ):
        found.append(Reason.POSE)
    if _blind(s, now, status, gate):
        found.append(Reason.SCAN)
    if state is not None and (where := place(s, state)) is not None:
        found.append(where)
    told = {
        Reason.FRAME: status.frame_doubt,
        Reason.RESTARTED: status.restarted,
        Reason.UNMOVED: status.unmoved,
    }
    found += [reason for reason, wrong in told.items() if wrong]
    if command is None or not fresh(now, command.stamp, s.watchdog):
        found.append(Reason.COMMAND)
    if command is not None and not all(map(math.isfinite, command.speeds)):
        found.append(Reason.COMMAND_INVALID)
    return tuple(found)


def _blind(s: GateSettings, now: float, status: LinkStatus, gate: GateState) -> bool:
    """Whether a robot with a lidar has no fresh scan."""
    oldest = s.scan_age * (GRACE if gate is GateState.ACTIVE else 1.0)
    return status.scan_stamp is not None and not fresh(now, status.scan_stamp, oldest)


def place(s: GateSettings, state: State) -> Reason | None:
    """What is wrong with the robot's pose: not finite, or outside the geofence."""
    if not all(map(math.isfinite, (state.x, state.y, state.theta, state.v, state.omega, state.vy))):
        return Reason.POSE_INVALID
    if s.geofence is not None:
        x_min, y_min, x_max, y_max = s.geofence
        if not (x_min <= state.x <= x_max and y_min <= state.y <= y_max):
            return Reason.GEOFENCE
    return None


def fresh(now: float, stamp: float, limit: float) -> bool:
    """Whether a stamp is young enough; one from the future is not to be trusted. False for NaN."""
    return -FUTURE <= now - stamp <= limit


class Slowing:
    """Slows the robot before pose, scan or command is too old, so that a gap is not yet a stop.

    `settings`: `watchdog`, `pose_age`, `scan_age` and `slow_from` are used. `late_after`: age at
    which a command is late, if later than the settings say [s].
    """

    def __init__(self, settings: GateSettings, late_after: float | None) -> None:
        self._settings = settings
        own = settings.slow_from * settings.watchdog
        self._late = min(max(own, late_after or 0.0), settings.watchdog)

    def share(
        self, now: float, command: VelocityCommand, state: State | None, status: LinkStatus
    ) -> float:
        """Share of its speed limits that the robot may drive now."""
        s = self._settings
        scan = now if status.scan_stamp is None else status.scan_stamp
        pose = min(status.pose_stamp, -math.inf if state is None else state.stamp)
        return min(
            falling(now - pose, s.slow_from * s.pose_age, s.pose_age),
            falling(now - scan, s.slow_from * s.scan_age, s.scan_age),
            falling(now - command.stamp, self._late, s.watchdog),
        )


def falling(age: float, late: float, latest: float) -> float:
    """Fall from 1 at the age `late` to 0 at `latest`.

    Examples
    --------
    >>> [falling(age, 0.25, 0.75) for age in (-0.1, 0.25, 0.5, 0.75, 2.0)]
    [1.0, 1.0, 0.5, 0.0, 0.0]
    """
    if age <= late:
        return 1.0
    return 0.0 if age >= latest else (latest - age) / (latest - late)


POSE_LOST = frozenset({Reason.POSE, Reason.SCAN, Reason.ESTIMATE, Reason.COMMAND})
"""What is wrong when only the pose, or the sight, is lost; there is no new command then either."""


class LostPose:
    """Follows the poses of a robot that drives or has just been stopped.

    `settings`: `resume` and `resume_within` are used.
    """

    def __init__(self, settings: GateSettings) -> None:
        self._settings = settings
        self._pose_only = False
        self._good: tuple[float, float] | None = None

    def strayed(
        self, gate: GateState, state: State | None, status: LinkStatus, reasons: tuple[Reason, ...]
    ) -> bool:
        """Take a step's inputs; tell whether the pose came back too far from where it was lost."""
        if gate not in DRIVING:
            self._pose_only, self._good = False, None
            return False
        # a board that distrusts its estimate reports that as a fault, too
        excused = POSE_LOST if status.pose_ok else POSE_LOST | {Reason.BOARD}
        before = gate is GateState.ACTIVE or self._pose_only
        self._pose_only = before and excused.issuperset(reasons)
        if reasons or state is None:
            return False
        last, self._good = self._good, (state.x, state.y)
        if last is None or not self._settings.resume:
            return False
        return math.dist(last, self._good) > self._settings.resume_within

    def patience(self, final: bool) -> float:
        """How long zeros are sent before the release [s]: longer where only the pose is lost."""
        s = self._settings
        return max(s.hold, s.resume) if self._pose_only and not final else s.hold
