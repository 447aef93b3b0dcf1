"""The gate, transition by transition, and what it sends in each state."""

import math
from dataclasses import replace

import pytest

from firmware_bridge.messages import ConfigError, LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import LONGEST_RISE, RESEND, GateOutput, SafetyGate
from firmware_bridge.safety.gate_inputs import FUTURE
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import (
    BY_STATE,
    REQUESTS,
    TRANSITIONS,
    Action,
    Event,
    GateState,
    Reason,
)
from firmware_bridge.safety.limits import Limits

TICK = 0.02
SETTINGS = GateSettings(geofence=(-5.0, -5.0, 5.0, 5.0))


class World:
    """A gate with good inputs at every tick, which a test then spoils."""

    def __init__(self, pilot: bool = True) -> None:
        self.gate, self.now, self.command = (
            SafetyGate(replace(SETTINGS, pilot=pilot)),
            100.0,
            (0.3, 0.4),
        )
        self.ready, self.x, self.pose_ok, self.connected = True, 0.0, True, True
        self.frame_doubt = ""
        self.faults: tuple[str, ...] = ()
        self.silent: set[str] = set()
        self.stamps = dict.fromkeys(("command", "pose", "source", "heartbeat"), self.now)
        self.outputs: list[GateOutput] = []

    def step(self) -> GateOutput:
        self.now += TICK
        for name in self.stamps.keys() - self.silent:
            self.stamps[name] = self.now
        status = LinkStatus(
            self.connected,
            self.stamps["heartbeat"],
            self.stamps["source"],
            self.ready,
            self.pose_ok,
            faults=self.faults,
            frame_doubt=self.frame_doubt,
        )
        state = State(self.x, 0.0, 0.0, 0.0, 0.0, self.stamps["pose"])
        self.outputs.append(
            self.gate.step(
                self.now, VelocityCommand(*self.command, self.stamps["command"]), state, status
            )
        )
        return self.outputs[-1]

    def run(self, seconds: float) -> GateOutput:
        for _ in range(max(1, round(seconds / TICK))):
            output = self.step()
        return output

    def drive(self) -> "World":
        self.gate.enable()
        output = self.run(2.0)
        assert (output.state, output.v, output.omega) == (
            GateState.ACTIVE,
            *SETTINGS.limits.clip(*self.command),
        )
        return self


def into(state: GateState) -> World:
    """A world whose gate is in `state`."""
    world = World()
    if state is GateState.IDLE:
        world.run(1.0)
    elif state is GateState.WAITING:
        world.silent = {"pose"}
        world.run(0.5)
        world.gate.enable()
        world.run(1.0)
    elif state is GateState.ESTOP:
        world.drive().gate.estop()
        world.step()
    elif state is GateState.YIELDED:
        world.drive().ready = False
        world.step()
    else:
        world.drive()
        if state is not GateState.ACTIVE:
            world.silent = {"command"}
            while world.step().state is not state:
                assert world.now < 110.0
    assert world.gate.state is state
    return world


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


SPOIL = {
    Reason.LINK: lambda w: setattr(w, "connected", False),
    Reason.HEARTBEAT: lambda w: w.silent.add("heartbeat"),
    Reason.BOARD: lambda w: setattr(w, "faults", ("over-temperature",)),
    Reason.ESTIMATE: lambda w: setattr(w, "pose_ok", False),
    Reason.POSE: lambda w: w.silent.add("pose"),
    Reason.POSE_INVALID: lambda w: setattr(w, "x", math.nan),
    Reason.FRAME: lambda w: setattr(w, "frame_doubt", "restarted"),
    Reason.GEOFENCE: lambda w: setattr(w, "x", 5.01),
    Reason.COMMAND: lambda w: w.silent.add("command"),
    Reason.COMMAND_INVALID: lambda w: setattr(w, "command", (math.nan, 0.0)),
}


@pytest.mark.parametrize("reason", SPOIL, ids=lambda r: r.name)
def test_each_reason_alone_stops_within_300_ms_and_is_told(reason):
    world = World().drive()
    SPOIL[reason](world)
    lost, speed = world.now, world.outputs[-1].v
    while world.step().v >= speed:
        assert world.now - lost <= 0.3
    assert world.now - lost <= 0.3
    while reason not in world.outputs[-1].reasons:  # a robot is slowed before it is stopped
        assert world.step().v < speed
        assert world.now - lost <= 0.4
    assert world.outputs[-1].state is GateState.STOPPING
    world.run(0.5)
    assert (world.outputs[-1].v, world.outputs[-1].omega, world.outputs[-1].state) == (
        0.0,
        0.0,
        GateState.HOLDING,
    )


def test_every_reason_is_covered_above():
    elsewhere = {Reason.NOT_READY, Reason.SCAN}  # the latter in test_gate_scan.py
    assert set(SPOIL) | elsewhere == set(Reason)


def test_the_source_of_the_pose_counts_and_not_only_its_echo():
    world = World().drive()
    world.silent = {"source"}
    world.run(0.4)
    assert world.gate.state is GateState.STOPPING and world.outputs[-1].reasons == (Reason.POSE,)


@pytest.mark.parametrize("name", ["command", "pose", "source", "heartbeat"])
def test_a_stamp_from_the_future_is_not_fresh(name):
    world = World().drive()
    world.silent = {name}
    world.stamps[name] = world.now + TICK + 2 * FUTURE
    assert world.step().state is GateState.STOPPING


def test_a_short_loss_recovers_by_itself_and_a_long_one_only_when_enabled():
    world = World().drive()
    world.silent = {"pose"}
    world.run(0.6)
    world.silent = set()
    assert world.run(0.4).state in (GateState.STOPPING, GateState.HOLDING)
    assert world.run(0.4).state is GateState.ACTIVE
    world.run(1.0)
    world.silent = {"pose"}
    world.run(2.0)
    assert world.gate.state is GateState.RELEASED
    world.silent = set()
    assert world.run(5.0).state is GateState.RELEASED
    world.gate.enable()
    assert world.run(1.0).state is GateState.ACTIVE


def test_outside_the_geofence_it_never_recovers_by_itself():
    world = World().drive()
    world.x = 5.01
    world.run(0.1)
    world.x = 0.0
    assert world.run(5.0).state is GateState.RELEASED


def test_a_stop_that_was_asked_for_is_not_undone_by_good_inputs():
    world = World().drive()
    world.gate.stop()
    states = []
    for _ in range(200):
        states.append(world.step().state)
    assert GateState.ACTIVE not in states and states[-1] is GateState.RELEASED


def test_ramp_then_zeros_for_a_second_then_release_until_the_board_obeys():
    world = World().drive()
    world.gate.stop()
    zero_from = released_at = None
    while released_at is None:
        output = world.step()
        if output.action is Action.RELEASE:
            released_at = world.now
        elif (output.v, output.omega) == (0.0, 0.0) and zero_from is None:
            zero_from = world.now
    assert released_at - zero_from == pytest.approx(1.0, abs=2 * TICK)
    assert not world.gate.done
    again = [world.step().action for _ in range(round(2.1 * RESEND / TICK))]
    assert again.count(Action.RELEASE) == 2 and again.count(Action.SEND) == 0
    world.ready = False
    assert world.step().action is Action.NOTHING and world.gate.done
    # whoever takes it back to GUIDED now has it
    world.ready = True
    assert {o.action for o in (world.step() for _ in range(100))} == {Action.NOTHING}


def test_a_plain_board_is_released_once():
    world = World(pilot=False).drive()
    world.gate.stop()
    world.run(5.0)
    assert [o.action for o in world.outputs].count(Action.RELEASE) == 1
    assert world.gate.done and world.outputs[-1].action is Action.NOTHING


def test_a_release_is_sent_again_when_the_link_was_down():
    world = World(pilot=False).drive()
    world.silent, world.connected = {"heartbeat"}, False
    world.run(5.0)
    assert [o.action for o in world.outputs].count(Action.RELEASE) > 3 and not world.gate.done
    world.silent, world.connected = set(), True
    world.run(RESEND + 2 * TICK)
    assert world.gate.done


def test_a_pilot_who_takes_over_keeps_the_robot():
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


@pytest.mark.parametrize("pilot", [True, False])
def test_emergency_stop_is_zero_at_once_and_latched(pilot):
    world = World(pilot).drive()
    world.gate.estop()
    output = world.step()
    assert (output.state, output.v, output.omega) == (GateState.ESTOP, 0.0, 0.0)
    assert output.action is (Action.RELEASE if pilot else Action.SEND)
    world.gate.enable()
    world.gate.stop()
    world.run(10.0)
    assert world.gate.state is GateState.ESTOP
    assert all((o.v, o.omega) == (0.0, 0.0) for o in world.outputs if o.state is GateState.ESTOP)
    world.gate.reset()
    assert world.run(5.0).state is GateState.IDLE
    world.gate.enable()
    assert world.run(1.0).state is GateState.ACTIVE


def test_a_plain_board_brakes_for_a_second_before_it_is_released():
    world = World(pilot=False).drive()
    world.gate.estop()
    world.run(1.0)
    assert [o.action for o in world.outputs if o.state is GateState.ESTOP] == [Action.SEND] * 50
    assert world.run(2 * TICK).action is not Action.SEND
    assert world.run(1.0).action is Action.NOTHING and world.gate.done


def test_an_emergency_stop_is_repeated_until_obeyed_and_when_somebody_lifts_it():
    world = into(GateState.ESTOP)
    world.run(1.6)
    assert [o.action for o in world.outputs if o.state is GateState.ESTOP].count(
        Action.RELEASE
    ) == 4
    world.ready = False
    assert world.run(1.0).action is Action.NOTHING
    world.ready = True
    assert world.step().action is not Action.NOTHING


def test_a_plain_board_that_is_not_ready_is_a_fault_and_takes_its_motors_back_by_zeros():
    world = World(pilot=False).drive()
    world.ready = False
    assert world.step().state is GateState.STOPPING
    world.run(3.0)
    assert world.gate.state is GateState.RELEASED and world.gate.done
    world.gate.enable()
    output = world.run(1.0)
    assert (output.state, output.action, output.v) == (GateState.WAITING, Action.SEND, 0.0)
    world.ready = True
    assert world.run(1.0).state is GateState.ACTIVE


def test_an_emergency_stop_beats_a_reset_in_the_same_step():
    world = World().drive()
    world.gate.reset()
    world.gate.estop()
    world.gate.enable()
    assert world.run(1.0).state is GateState.ESTOP


def test_a_gate_that_was_held_up_brakes_for_the_whole_time_and_speeds_up_for_a_little():
    """With a tick every 0.9 s the ramp took 3.64 s instead of 0.20 s."""
    limits = Limits(v_max=1.0, acceleration=1.0, deceleration=2.0)
    for pause, speed in ((0.02, 0.96), (0.1, 0.8), (0.3, 0.4), (0.9, 0.0)):
        assert limits.slew((1.0, 0.0), (0.0, 0.0), pause, LONGEST_RISE)[0] == pytest.approx(speed)
        risen = limits.slew((0.0, 0.0), (1.0, 0.0), pause, LONGEST_RISE)[0]
        assert risen == pytest.approx(min(pause, LONGEST_RISE))
    world = World().drive()
    world.gate.stop()
    assert world.step().state is GateState.STOPPING
    world.now += 0.88
    assert (world.step().v, world.outputs[-2].v > 0.2) == (0.0, True)


def test_time_that_stands_or_runs_back_moves_no_command():
    world = World()
    world.gate.enable()
    world.run(0.54)
    before = world.outputs[-1]
    assert before.state is GateState.ACTIVE and before.v < 0.3
    for jump in (TICK, 3.0):  # no time at all; then back
        world.now -= jump
        world.stamps = dict.fromkeys(world.stamps, world.now)
        world.step()
        world.now -= TICK
    assert all(
        abs(b.v - a.v) <= TICK + 1e-9
        for a, b in zip(world.outputs, world.outputs[1:], strict=False)
    )


@pytest.mark.parametrize("name", ["watchdog", "pose_age", "heartbeat_age", "hold", "settle"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1", None])
def test_settings_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        replace(SETTINGS, **{name: value})


@pytest.mark.parametrize(
    "fence",
    [(0, 0, 0, 1), (0, 0, 1), (0, 0, 1, math.nan), (1, 0, 0, 1), (0, 0, True, 1), ("0", 0, 1, 1)],
)
def test_a_geofence_is_checked(fence):
    with pytest.raises(ConfigError, match="geofence"):
        GateSettings(geofence=fence)


@pytest.mark.parametrize("name", [f for f in Limits.__dataclass_fields__ if f != "v_reverse"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1"])
def test_limits_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        Limits(**{name: value})
    assert Limits(v_reverse=0.0).clip(-1.0, 0.5) == (0.0, 0.0)
