"""How the gate stops: ramp, zeros, release, the emergency stop, also where time does not flow."""

import pytest
from gate_world import TICK, World, into

from firmware_bridge.messages import STILL
from firmware_bridge.safety.gate import LONGEST_RISE, RESEND
from firmware_bridge.safety.gate_settings import Limits
from firmware_bridge.safety.gate_table import Action, GateState


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
    # a station that takes it back to GUIDED now has it
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


def test_an_emergency_stop_is_repeated_until_obeyed_and_when_it_is_lifted():
    world = into(GateState.ESTOP)
    world.run(1.6)
    assert [o.action for o in world.outputs if o.state is GateState.ESTOP].count(
        Action.RELEASE
    ) == 4
    world.ready = False
    assert world.run(1.0).action is Action.NOTHING
    world.ready = True
    assert world.step().action is not Action.NOTHING


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
        assert limits.slew((1.0, 0.0, 0.0), STILL, pause, LONGEST_RISE)[0] == pytest.approx(speed)
        risen = limits.slew(STILL, (1.0, 0.0, 0.0), pause, LONGEST_RISE)[0]
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


def test_a_gate_that_stood_still_gives_the_robot_back_although_all_is_fresh_again():
    for stall, back in ((0.9, False), (1.1, True), (3600.0, True)):
        world = World().drive()
        world.now += stall
        world.run(5.0)
        assert (world.gate.state is GateState.RELEASED) == back
        world.gate.enable()
        assert world.run(1.0).state is GateState.ACTIVE


def test_a_stall_while_the_robot_is_held_is_no_way_to_drive_on():
    world = World().drive()
    world.silent = {"pose"}
    world.run(0.8)
    assert world.gate.state is GateState.HOLDING
    world.silent = set()
    world.now += 60.0
    world.run(5.0)
    assert world.gate.state is GateState.RELEASED
