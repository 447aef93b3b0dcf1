"""Each reason for which the gate stops a robot, and after which of them it drives on."""

import math

import pytest
from gate_world import TICK, World

from firmware_bridge.safety.gate_table import FUTURE, Action, GateState, Reason

SPOIL = {
    Reason.LINK: lambda w: setattr(w, "connected", False),
    Reason.HEARTBEAT: lambda w: w.silent.add("heartbeat"),
    Reason.BOARD: lambda w: setattr(w, "faults", ("over-temperature",)),
    Reason.ESTIMATE: lambda w: setattr(w, "pose_ok", False),
    Reason.POSE: lambda w: w.silent.add("pose"),
    Reason.POSE_INVALID: lambda w: setattr(w, "x", math.nan),
    Reason.FRAME: lambda w: setattr(w, "frame_doubt", "restarted"),
    Reason.RESTARTED: lambda w: setattr(w, "restarted", True),
    Reason.UNMOVED: lambda w: setattr(w, "unmoved", "commanded to drive 0.15 m"),
    Reason.STALLED: lambda w: w.gate.slept(),
    Reason.GEOFENCE: lambda w: setattr(w, "x", 5.01),
    Reason.COMMAND: lambda w: w.silent.add("command"),
    Reason.COMMAND_INVALID: lambda w: setattr(w, "command", (math.nan, 0.0)),
}


@pytest.mark.parametrize("reason", SPOIL, ids=lambda r: r.name)
def test_each_reason_alone_stops_within_300_ms_and_is_reported(reason):
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


def test_after_a_restart_of_the_board_it_drives_on_only_when_enabled():
    world = World(pilot=False).drive()
    world.restarted = True
    world.run(0.1)
    world.restarted = False
    assert world.run(5.0).state is GateState.RELEASED
    world.gate.enable()
    assert world.run(1.0).state is GateState.ACTIVE


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
