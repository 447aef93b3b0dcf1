"""The gate, transition by transition, and what it sends in each state."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from gate_world import SETTINGS, World, into

from firmware_bridge.messages import STILL, ConfigError, LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings, Limits
from firmware_bridge.safety.gate_table import (
    BY_STATE,
    GRACE,
    REQUESTS,
    TRANSITIONS,
    Action,
    Event,
    GateState,
    Reason,
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


def test_a_pilot_that_takes_over_keeps_the_robot():
    world = World().drive()
    world.ready = False
    first = world.step()
    assert (first.state, first.action) == (GateState.YIELDED, Action.NOTHING)
    world.ready = True
    assert {world.step().action for _ in range(500)} == {Action.NOTHING}
    world.gate.stop()
    world.step()
    assert world.gate.state is GateState.YIELDED and world.gate.done
    world.gate.enable()
    assert world.run(1.0).state is GateState.ACTIVE


def test_a_mode_that_is_not_heard_is_a_lost_link_and_no_pilot():
    world = World().drive()
    world.ready, world.silent = False, {"heartbeat"}
    world.stamps["heartbeat"] -= 1.0
    assert world.step().state is GateState.STOPPING
    world.silent = set()
    assert world.step().state is GateState.YIELDED


def test_a_stop_while_the_pilot_drives_sends_nothing():
    world = into(GateState.WAITING)
    world.ready = False
    world.gate.stop()
    assert world.step().state is GateState.YIELDED and world.outputs[-1].action is Action.NOTHING


TICK = 0.02
GOOD = LinkStatus(True, 0.0, 0.0, True, scan_stamp=0.0)


def drive(gate, since, until, scan, good=GOOD):
    """Ticks with all inputs fresh but the scan; gives the outputs."""
    outputs, now = [], since
    while now < until - 1e-9:
        status = replace(good, heartbeat_stamp=now, pose_stamp=now, scan_stamp=scan(now))
        state = State(0.0, 0.0, 0.0, 0.0, 0.0, now)
        outputs.append((now, gate.step(now, VelocityCommand(0.3, 0.0, now), state, status)))
        now += TICK
    return outputs


def test_a_robot_with_a_lidar_waits_for_its_first_scan():
    gate = SafetyGate(GateSettings(pilot=False))
    gate.enable()
    outputs = drive(gate, 10.0, 12.0, lambda now: -math.inf)
    assert {o.state for _, o in outputs} == {GateState.WAITING}
    assert all(o.reasons == (Reason.SCAN,) and o.v == 0.0 for _, o in outputs)
    outputs = drive(gate, 12.0, 14.0, lambda now: now - 0.1)
    assert outputs[-1][1].state is GateState.ACTIVE and outputs[-1][1].v == pytest.approx(0.3)


@pytest.mark.parametrize("age", [0.3, 0.5])
def test_a_dead_lidar_slows_the_robot_then_stops_and_releases_it(age):
    settings = GateSettings(pilot=False, scan_age=age)
    gate = SafetyGate(settings)
    gate.enable()
    drive(gate, 10.0, 12.0, lambda now: now)
    outputs = drive(gate, 12.0, 16.0, lambda now: 12.0)
    for now, output in outputs:
        if now - 12.0 < settings.slow_from * age:
            assert output.v == pytest.approx(0.3)
    ramp = 0.3 / settings.limits.deceleration + 2 * TICK
    assert all(o.v == 0.0 for now, o in outputs if now - 12.0 > age + ramp)
    stopping = [now for now, o in outputs if o.state is not GateState.ACTIVE]
    assert stopping[0] - 12.0 == pytest.approx(GRACE * age, abs=2 * TICK)
    assert outputs[-1][1].state is GateState.RELEASED


def test_a_turn_that_is_left_out_is_no_stop():
    gate = SafetyGate(GateSettings(pilot=False))
    gate.enable()
    drive(gate, 10.0, 12.0, lambda now: now)
    outputs = drive(gate, 12.0, 12.4, lambda now: 12.0 - 0.18)  # two turns of an RPLIDAR
    assert {o.state for _, o in outputs} == {GateState.ACTIVE}


@pytest.mark.parametrize("stamp", [math.nan, math.inf])
def test_a_stamp_that_is_none_counts_as_none(stamp):
    gate = SafetyGate(GateSettings(pilot=False))
    gate.enable()
    outputs = drive(gate, 10.0, 12.0, lambda now: stamp)
    assert outputs[-1][1].state is GateState.WAITING


@pytest.mark.parametrize("name", ["watchdog", "pose_age", "heartbeat_age", "hold", "settle"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1", None])
def test_settings_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        replace(SETTINGS, **{name: value})


@pytest.mark.parametrize(
    "fence",
    [(0, 0, 0, 1), (0, 0, 1), (0, 0, 1, math.nan), (0, 1, 1, 0), (0, 0, True, 1), ("0", 0, 1, 1)],
)
def test_a_geofence_is_checked(fence):
    with pytest.raises(ConfigError, match="geofence"):
        GateSettings(geofence=fence)


@pytest.mark.parametrize("name", [f for f in Limits.__dataclass_fields__ if f != "v_reverse"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1"])
def test_limits_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        Limits(**{name: value})
    assert Limits(v_reverse=0.0).clip((-1.0, 0.5, 0.1)) == STILL
    # what rounding leaves of a standstill does not keep a forward-only robot from turning
    assert Limits(v_reverse=0.0).clip((-1e-9, 0.5, 0.0)) == (0.0, 0.5, 0.0)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("v_max", 0.0, "expected 0.0001 to 100 m/s, got 0.0"),
        ("omega_max", 400.0, "expected 0.0001 to 100 rad/s, got 400.0"),
        ("angular_acceleration", True, "expected 0.001 to 10000 rad/s^2, got True"),
    ],
)
def test_a_limit_is_refused_with_its_own_range_and_unit(name, value, words):
    with pytest.raises(ConfigError, match=f"^{re.escape(f'{name}: {words}')}$"):
        Limits(**{name: value})
