"""The gate, transition by transition, and what it sends in each state."""

import pytest
from gate_world import World, into

from firmware_bridge.safety.gate_table import (
    BY_STATE,
    REQUESTS,
    TRANSITIONS,
    Action,
    Event,
    GateState,
)


def happen(world: World, event: Event) -> None:
    """Make one event happen, and nothing else that matters."""
    if event in REQUESTS:
        world.pose_ok = (
            event is not Event.ENABLE or world.gate.state is GateState.ACTIVE
        )  # so that it stays where the event leads
        {
            Event.ESTOP: world.gate.estop,
            Event.RESET: world.gate.reset,
            Event.ENABLE: world.gate.enable,
            Event.STOP: world.gate.stop,
        }[event]()
        world.step()
    elif event is Event.TAKEN:
        world.silent, world.ready = set(), False
        world.step()
    elif event is Event.FAULT:
        world.pose_ok = False
        world.step()
    elif event is Event.STILL:
        world.silent = {"command"}
        world.run(0.5)
    elif event is Event.HELD:
        world.silent = {"command"}
        world.run(1.1)
    elif event is Event.CLEAR:
        world.ready, world.silent = True, set()
        world.run(0.54)


@pytest.mark.parametrize(
    "transition", TRANSITIONS, ids=lambda t: f"{t.state.name}-{t.event.name}-{t.then.name}"
)
def test_each_transition_of_the_table(transition):
    world = into(transition.state)
    happen(world, transition.event)
    assert world.gate.state is transition.then


OUTSIDE = (Event.ESTOP, Event.RESET, Event.ENABLE, Event.STOP, Event.TAKEN, Event.FAULT)
UNLISTED = [(s, e) for s in GateState for e in OUTSIDE if e not in {t.event for t in BY_STATE[s]}]


@pytest.mark.parametrize(("state", "event"), UNLISTED, ids=lambda x: x.name)
def test_an_event_that_the_table_does_not_list_changes_nothing(state, event):
    world = into(state)
    others = {Event.HELD, Event.STILL}  # what time alone brings
    allowed = {state} | {t.then for t in BY_STATE[state] if t.event in others}
    happen(world, event)
    assert world.gate.state in allowed


def test_the_table_reaches_every_state_and_leads_out_of_every_state():
    assert {t.then for t in TRANSITIONS} == set(GateState)
    assert {t.state for t in TRANSITIONS} == set(GateState)
    assert [t for t in TRANSITIONS if t.state is GateState.ESTOP] == [
        t for t in TRANSITIONS if t.event is Event.RESET
    ]


@pytest.mark.parametrize(
    ("state", "action"),
    [
        (GateState.IDLE, Action.NOTHING),
        (GateState.WAITING, Action.SEND),
        (GateState.ACTIVE, Action.SEND),
        (GateState.STOPPING, Action.SEND),
        (GateState.HOLDING, Action.SEND),
        (GateState.RELEASED, Action.RELEASE),
        (GateState.YIELDED, Action.NOTHING),
        (GateState.ESTOP, Action.RELEASE),
    ],
)
def test_what_is_sent_in_each_state(state, action):
    output = into(state).outputs[-1]
    assert output.action is action
    if state not in (GateState.ACTIVE, GateState.STOPPING):
        assert (output.v, output.omega) == (0.0, 0.0)


def test_waiting_feeds_zeros_to_a_board_that_is_ready():
    world = World()
    world.silent = {"pose"}
    world.run(1.0)
    world.gate.enable()
    output = world.run(1.0)
    assert (output.state, output.action, output.v, output.omega) == (
        GateState.WAITING,
        Action.SEND,
        0.0,
        0.0,
    )
    world.silent = {"pose", "heartbeat"}
    assert world.run(0.5).action is Action.NOTHING
