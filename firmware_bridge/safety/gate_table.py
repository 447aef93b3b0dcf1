"""States, events and transitions of the safety gate: one table for gate, docs and tests."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
