"""Modes, arming and failsafes of the emulated rover."""

import math

import pytest
from ground_station import ACCEPTED, FAILED, UNSUPPORTED, Ground
from mavlink_rig import dialect

from kmpc_lab.emulator.rover.autopilot import HOLD


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
