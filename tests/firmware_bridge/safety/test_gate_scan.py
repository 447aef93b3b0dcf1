"""The gate and the scans of a robot's lidar: without fresh ones it is slowed, then stopped."""

import math
from dataclasses import replace

import pytest

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_inputs import GRACE
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState, Reason

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
