"""Modes, arming and failsafes of the emulated rover."""

from __future__ import annotations

import math

import numpy as np
import pytest
from ground_station import ACCEPTED, FAILED, UNSUPPORTED, Ground
from mavlink_rig import dialect

from kmpc_lab.emulator.rover.autopilot import HOLD
from kmpc_lab.emulator.rover.physics import Demand, DriveLimits, RoverPhysics


class TestArming:
    """Refusals after boot."""

    def test_refused_for_a_while_after_boot(self) -> None:
        ground = Ground(arm_after=30.0)
        ground.run(0.5)
        assert "PreArm: Gyros not calibrated" in ground.texts()
        assert ground.command(400, 1.0) == FAILED
        assert ground.texts() == ["Arm: Gyros not calibrated"]
        assert not ground.rover.armed
        ground.run(30.0)
        assert ground.command(400, 1.0) == ACCEPTED
        assert ground.rover.armed
        assert ground.command(400, 0.0) == ACCEPTED
        assert not ground.rover.armed


class TestModes:
    """Mode changes and what the heartbeat shows of them."""

    def test_what_is_not_emulated_is_refused(self) -> None:
        ground = Ground()
        ground.run(3.0)
        for mode in (10, 11, 99):
            assert ground.command(176, 1.0, mode) == FAILED
        assert ground.command(176, 0.0, HOLD) == UNSUPPORTED
        assert ground.rover.mode == "MANUAL"

    @pytest.mark.parametrize("how", ["manual_control", "override"])
    def test_a_pilot_drives_by_hand(self, how: str) -> None:
        ground = Ground()
        ground.run(3.0)
        ground.rover.pilot_arm()
        stick = (
            dialect.MAVLink_manual_control_message(1, 0, 200, 250, 0, 0)
            if how == "manual_control"
            else dialect.MAVLink_rc_channels_override_message(1, 1, 1600, 65535, 1625, *[65535] * 5)
        )
        ground.run(5.0, lambda: ground.say(stick))
        east, north, turn = ground.rover.velocity
        assert math.hypot(east, north) == pytest.approx(0.5, abs=0.01)
        assert turn == pytest.approx(-0.2 * math.radians(120.0), abs=0.01), "stick to the right"
        ground.run(5.0)
        assert ground.rover.stopped, "sticks that fall silent are let go"


class TestFailsafes:
    """GCS and EKF."""

    def drive(self, system: int, kind: int = 6, **parameters: float) -> Ground:
        ground = Ground(system=system, parameters=parameters)
        ground.guided()
        beat = dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3)
        ground.run(2.0, lambda: ground.say(beat))
        ground.drive(0.3, 0.0, 10.0)
        return ground

    def test_on_it_holds_when_its_ground_station_falls_silent(self) -> None:
        ground = self.drive(255, FS_GCS_ENABLE=1.0)
        assert ground.rover.mode == "HOLD"
        assert "GCS Failsafe" in ground.texts()
        assert ground.rover.stopped

    def test_the_ekf_failsafe_holds_after_a_second(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.3, 0.0, 1.0)
        ground.rover.lose_position()
        ground.drive(0.3, 0.0, 0.9)
        assert ground.rover.mode == "GUIDED"
        ground.drive(0.3, 0.0, 0.2)
        assert ground.rover.mode == "HOLD"
        ground.rover.lose_position(False)
        ground.run(0.5)
        assert "EKF failsafe cleared" in ground.texts()


LIMITS = DriveLimits(1.0, 1.0, math.radians(120.0), math.radians(120.0))
DT = 0.02


def run(physics: RoverPhysics, demand: Demand, seconds: float) -> np.ndarray:
    """Forward speed and turn rate after each period."""
    rows = []
    for _ in range(round(seconds / DT)):
        heading = physics.pose[2]
        physics.step(demand, LIMITS, DT)
        east, north, turn = physics.velocity
        middle = heading + 0.5 * DT * turn
        rows.append((east * math.cos(middle) + north * math.sin(middle), turn))
    return np.array(rows)


TIMES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.5)
"""After a step [s]; what follows was recorded from ArduPilot Rover 4.6.3, skid-steered, with
ATC_ACCEL_MAX and ATC_DECEL_MAX 1: eight steps each, their spread 0.04 at the most."""
SPEED_UP = (0.05, 0.15, 0.30, 0.47, 0.67, 0.84, 1.01, 1.07, 1.09, 1.08)
SPEED_DOWN = (1.00, 0.89, 0.74, 0.56, 0.36, 0.20, 0.09, 0.04, 0.01, 0.00)
TURN_UP = (0.26, 0.66, 0.98, 1.02, 0.99, 1.01, 1.00, 1.00, 1.00, 1.00)
TURN_DOWN = (0.73, 0.33, 0.02, -0.02, 0.01, 0.00, 0.00, 0.00, 0.00, 0.00)
ENVELOPE = 0.06


def at_times(values: np.ndarray, scale: float) -> list[float]:
    """Shares of a step at `TIMES`, from means over periods."""
    ends = np.arange(1, len(values) + 1) * DT - 0.5 * DT
    return list(np.interp(TIMES, ends, values / scale))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speed_steps_lie_in_the_envelope_recorded_from_the_firmware(sign: float) -> None:
    physics = RoverPhysics()
    up = run(physics, Demand(sign * 0.5), 2.5)[:, 0]
    assert at_times(up, sign * 0.5) == pytest.approx(SPEED_UP, abs=ENVELOPE)
    assert up[-1] / (sign * 0.5) == pytest.approx(1.04, abs=0.02)
    down = run(physics, Demand(), 2.0)[:, 0]
    assert at_times(down, sign * 0.5) == pytest.approx(SPEED_DOWN, abs=ENVELOPE)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turn_steps_lie_in_the_envelope_recorded_from_the_firmware(sign: float) -> None:
    physics = RoverPhysics()
    up = run(physics, Demand(None, sign * 0.6), 2.0)[:, 1]
    assert at_times(up, sign * 0.6) == pytest.approx(TURN_UP, abs=ENVELOPE)
    down = run(physics, Demand(), 2.0)[:, 1]
    assert at_times(down, sign * 0.6) == pytest.approx(TURN_DOWN, abs=ENVELOPE)


def test_braking_takes_the_measured_distance() -> None:
    physics = RoverPhysics()
    run(physics, Demand(0.5), 6.0)
    start = physics.pose[0]
    speeds = run(physics, Demand(), 2.0)[:, 0]
    assert physics.pose[0] - start == pytest.approx(0.225, abs=0.02)
    assert physics.stopped
    assert speeds.min() >= 0.0, "a brake does not reverse"
