"""What the emulated rover tells of itself, and poses that it is fed with."""

import math

import pytest
from ground_station import ACCEPTED, DENIED, Ground
from mavlink_rig import dialect

from kmpc_lab.emulator.rover.autopilot import GUIDED
from kmpc_lab.emulator.rover.parameters import MOTION_CAPTURE


class TestTelemetry:
    """Requests, limits, and what is reported."""

    @pytest.mark.parametrize(
        ("interval", "result"),
        [(25_000, ACCEPTED), (20_000, DENIED), (100, DENIED), (-1, ACCEPTED), (math.nan, DENIED)],
    )
    def test_at_most_forty_hertz(self, interval: float, result: int) -> None:
        assert Ground().command(511, 30.0, interval) == result

    def test_one_message_on_request(self) -> None:
        ground = Ground()
        assert ground.command(512, 148.0) == ACCEPTED
        (version,) = ground.of("AUTOPILOT_VERSION")
        assert version.flight_sw_version >> 8 == 0x040603
        assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        assert ground.command(510, 148.0) == ACCEPTED
        assert ground.of("MESSAGE_INTERVAL")[0].interval_us == -1

    def test_streams_of_the_old_kind(self) -> None:
        ground = Ground()
        ground.run(3.0)
        ground.say(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
        ground.heard.clear()
        ground.run(5.0)
        for kind in (
            "SYS_STATUS",
            "ATTITUDE",
            "LOCAL_POSITION_NED",
            "GLOBAL_POSITION_INT",
            "VFR_HUD",
            "GPS_RAW_INT",
            "EKF_STATUS_REPORT",
        ):
            assert len(ground.of(kind)) == pytest.approx(20, abs=1)
        ground.say(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 0))
        ground.run(0.1)
        ground.heard.clear()
        ground.run(5.0)
        assert {m.get_type() for m in ground.heard} == {"HEARTBEAT"}

    def test_time(self) -> None:
        ground = Ground(uptime=100.0, system=1)
        (reply,) = [
            m
            for m in ground.ask(dialect.MAVLink_timesync_message(0, 123456789))
            if m.get_type() == "TIMESYNC"
        ]
        assert reply.ts1 == 123456789
        assert reply.tc1 * 1e-9 == pytest.approx(100.0, abs=0.05)
        assert not [
            m
            for m in ground.ask(dialect.MAVLink_timesync_message(5, 6))
            if m.get_type() == "TIMESYNC"
        ]


class TestMotionCapture:
    """The pose from outside that looks valid for seven seconds after it has stopped."""

    def test_looks_valid_for_seven_seconds(self) -> None:
        ground = Ground(parameters=MOTION_CAPTURE)
        ground.say(dialect.MAVLink_set_gps_global_origin_message(1, 474000000, 85000000, 400000))
        vision = dialect.MAVLink_vision_position_estimate_message(0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.3)
        ground.run(3.0, lambda: ground.say(vision))
        assert len(ground.of("GPS_GLOBAL_ORIGIN")) == 1
        assert ground.command(176, 1.0, GUIDED) == ACCEPTED
        assert ground.rover.pilot_arm()
        assert ground.command(511, 32.0, 100_000.0) == ACCEPTED
        ground.heard.clear()
        ground.run(6.5)
        assert len(ground.of("LOCAL_POSITION_NED")) == pytest.approx(65, abs=1)
        assert (ground.of("LOCAL_POSITION_NED")[-1].x, ground.of("LOCAL_POSITION_NED")[-1].y) == (
            1.0,
            2.0,
        )
        ground.run(1.0)
        ground.heard.clear()
        ground.run(2.0)
        assert not ground.of("LOCAL_POSITION_NED")
        assert ground.rover.mode == "HOLD"
