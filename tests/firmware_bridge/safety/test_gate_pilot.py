"""A pilot that takes over has the robot, until the gate is enabled again."""

from gate_world import World, into

from firmware_bridge.safety.gate_table import Action, GateState


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
