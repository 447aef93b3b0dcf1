"""Authority: taken only when asked, never from a pilot, given back until confirmed."""

import random

import pytest
from mavlink_rig import Rig, dialect

from firmware_bridge.drivers.mavlink.authority import HEARTBEAT_LOST
from firmware_bridge.messages import VelocityCommand
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_table import Action, GateState, Reason
from kmpc_lab.emulator.rover.autopilot import GUIDED, HOLD, MANUAL


def commands(rig: Rig) -> list[tuple[int, float, float]]:
    """Commands that went to the rover: id, first and second parameter."""
    return [(m.command, m.param1, m.param2) for m in sent(rig) if m.get_type() == "COMMAND_LONG"]


def sent(rig: Rig) -> list[dialect.MAVLink_message]:
    parser = dialect.MAVLink(None)
    return [parser.decode(bytearray(frame)) for _, frame in rig.sent]


def test_without_arm_it_waits_for_the_pilot() -> None:
    rig = Rig()
    rig.run(10.0)
    assert not {176, 400} & {command for command, _, _ in commands(rig)}
    assert not rig.ready
    assert rig.rover.pilot_mode(GUIDED)
    assert rig.rover.pilot_arm()
    rig.until(lambda: rig.ready, 1.5)


@pytest.mark.parametrize("seed", range(2))
def test_lost_frames_only_delay(seed: int) -> None:
    noise, rig = random.Random(seed), Rig()
    rig.run(3.0)
    rig.to_rover = rig.to_core = lambda frame: [frame] * (noise.random() > 0.5)
    rig.core.take(rig.now)
    rig.until(lambda: rig.ready, 30.0)
    rig.drive(0.3, 0.0, 1.0)
    rig.core.stop(rig.now)
    rig.until(lambda: not rig.core.stopping, 30.0)
    assert rig.rover.mode == "HOLD"
    rig.run(3.0)
    assert rig.rover.stopped


def test_a_pilot_that_changes_the_mode_keeps_the_robot() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.4, 0.0, 1.0)
    rig.rover.pilot_mode(MANUAL)
    before = len(rig.sent)
    took = rig.until(lambda: not rig.ready, 1.0)
    assert took < 0.1
    rig.drive(0.4, 0.0, 10.0)
    assert rig.rover.mode == "MANUAL"
    assert rig.rover.armed
    assert not {176, 400} & {
        m.command for m in sent(rig)[before:] if m.get_type() == "COMMAND_LONG"
    }
    assert not any(m.get_type() == "SET_POSITION_TARGET_LOCAL_NED" for m in sent(rig)[before + 3 :])
    assert rig.core.counters["yielded"] == 1
    assert rig.core.counters["held_back"] > 400
    rig.core.stop(rig.now)
    rig.run(2.0)
    assert rig.rover.mode == "MANUAL", "a stop must not take the robot from its pilot"


def test_a_pilot_that_disarms_keeps_it_disarmed() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.4, 0.0, 1.0)
    rig.rover.pilot_arm(False)
    rig.until(lambda: not rig.ready, 0.5)
    rig.drive(0.4, 0.0, 10.0)
    assert not rig.rover.armed
    assert rig.rover.stopped


def test_a_pilot_that_intervenes_while_we_arm_ends_the_taking() -> None:
    rig = Rig(arm_after=20.0)
    rig.until(lambda: rig.core.identified)
    rig.core.take(rig.now)
    rig.until(lambda: rig.core.authority.mode == GUIDED)
    rig.run(0.5)
    rig.rover.pilot_mode(MANUAL)
    rig.run(30.0)
    assert rig.rover.mode == "MANUAL"
    assert not rig.rover.armed
    assert any("mode changed to MANUAL by somebody else" in fault for fault in rig.faults)


def test_stop_is_zeros_then_hold_until_both_are_certain() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.5, 0.3, 2.0)
    before = len(rig.sent)
    rig.core.stop(rig.now)
    first, second = sent(rig)[before : before + 2]
    assert (first.get_type(), first.vx, first.yaw_rate) == (
        "SET_POSITION_TARGET_LOCAL_NED",
        0.0,
        0.0,
    )
    assert (second.get_type(), second.command, second.param2) == ("COMMAND_LONG", 176, HOLD)
    assert rig.core.stopping
    rig.until(lambda: not rig.core.stopping, 0.5)
    assert rig.rover.mode == "HOLD"
    assert not rig.ready
    rig.until(lambda: rig.rover.stopped, 1.5)


def test_stop_goes_on_over_a_dead_link_until_it_is_confirmed() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.5, 0.0, 1.0)
    rig.to_rover = lambda frame: []
    rig.core.stop(rig.now)
    rig.run(2.0)
    assert rig.core.stopping
    assert rig.ready, "the vehicle still obeys: nobody has told it otherwise"
    rig.core.set_point(0.5, 0.0, rig.now)
    assert rig.core.counters["held_back"] == 1
    rig.to_rover = lambda frame: [frame]
    rig.until(lambda: rig.rover.mode == "HOLD", 0.5)
    rig.until(lambda: not rig.core.stopping, 0.5)


def test_a_vehicle_that_boots_is_taken_once_it_knows_where_it_is() -> None:
    rig = Rig(arm_after=20.0)
    rig.core.take(rig.now)
    rig.run(10.0)
    assert not {176, 400} & {command for command, _, _ in commands(rig)}
    assert rig.faults[-1].startswith("waiting until the vehicle")
    rig.until(lambda: rig.ready, 20.0)


def test_a_vehicle_that_denies_guided_is_not_asked_for_ever() -> None:
    rig = Rig()
    rig.run(4.0)
    real = rig.rover._protocol._change_mode
    rig.rover._protocol._change_mode = lambda base, custom: (
        2 if custom == GUIDED else real(base, custom)
    )  # type: ignore[method-assign]
    rig.core.take(rig.now)
    rig.run(5.0)
    assert [c for c in commands(rig) if c[0] == 176] == [(176, 1.0, float(GUIDED))]
    assert "the vehicle refuses GUIDED" in rig.faults


def test_an_autopilot_in_failsafe_is_not_fought() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.4, 0.0, 1.0)
    rig.rover.lose_position()
    rig.drive(0.4, 0.0, 2.0)
    assert rig.rover.mode == "HOLD"
    rig.rover.lose_position(False)
    rig.drive(0.4, 0.0, 10.0)
    assert rig.rover.mode == "HOLD"
    assert not rig.ready


def test_without_heartbeats_the_mode_is_not_believed_for_long() -> None:
    rig = Rig()
    rig.take()
    rig.to_core = lambda frame: [] if frame[7:10] == b"\0\0\0" else [frame]
    rig.run(2.2)
    assert rig.ready
    rig.run(1.0)
    assert not rig.ready


def only_heartbeats(keep) -> object:
    """A filter of frames: of the HEARTBEATs those whose number since now `keep` takes, and
    everything else.
    """
    count = 0

    def pass_on(frame: bytes) -> list[bytes]:
        nonlocal count
        if frame[7:10] != b"\0\0\0":
            return [frame]
        count += 1
        return [frame] if keep(count) else []

    return pass_on


def test_a_vehicle_without_heartbeats_that_still_obeys_is_braked_not_left_to_a_pilot() -> None:
    rig, gate = Rig(), SafetyGate()
    rig.take()
    gate.enable()

    def tick() -> None:
        state, status = rig.core.state, rig.core.status(rig.now, True)
        output = gate.step(rig.now, VelocityCommand(0.3, 0.0, rig.now), state, status)
        if output.action is Action.SEND:
            rig.core.set_point(output.v, output.omega, rig.now)
        elif output.action is Action.RELEASE:
            rig.core.stop(rig.now)

    rig.run(3.0, tick)
    assert gate.state is GateState.ACTIVE and abs(rig.rover.velocity[0]) > 0.25
    lost, held_back = rig.core.authority.heard, rig.core.counters["held_back"]
    rig.to_core = only_heartbeats(lambda k: False)
    rig.run(lost + HEARTBEAT_LOST - rig.now - 0.05, tick)
    assert gate.state is GateState.ACTIVE
    rig.run(0.1, tick)
    assert gate.state is GateState.STOPPING
    assert {Reason.HEARTBEAT, Reason.NOT_READY} <= set(
        gate.step(rig.now, None, rig.core.state, rig.core.status(rig.now, True)).reasons
    )
    rig.run(0.4, tick)
    # down a ramp, not in one step: the vehicle obeys for all we know
    assert gate.state is GateState.HOLDING and rig.core.counters["held_back"] == held_back
    rig.run(1.0, tick)
    assert abs(rig.rover.velocity[0]) < 0.02
    rig.run(2.0, tick)
    assert rig.rover.mode == "HOLD"


def test_a_lost_heartbeat_is_no_false_alarm_at_one_a_second() -> None:
    rig = Rig()
    rig.take()
    # of five a second one in five comes: the protocol's 1 Hz; and of those every other one is lost
    rig.to_core = only_heartbeats(lambda k: k % 10 == 0)
    ready: list[bool] = []
    rig.run(20.0, lambda: ready.append(rig.ready))
    assert all(ready)
