"""The emulated rover as its ground station meets it.

One message in, what comes out, on a clock of the tests' own.
"""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable

import pytest
from mavlink_rig import crc16_mcrf4xx, dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.emulator.rover.autopilot import GUIDED, HOLD, MANUAL
from firmware_bridge.emulator.rover.parameters import DEFAULTS, MOTION_CAPTURE
from firmware_bridge.emulator.rover.rover import RoverEmulator

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
Message = dialect.MAVLink_message


class Ground:
    """A rover and somebody who talks to it."""

    def __init__(self, system: int = 255, component: int = 190, **rover: object) -> None:
        self.now = 50.0
        self.heard: list[Message] = []
        self._in, self._out = MavlinkCodec(9, 9), MavlinkCodec(system, component)
        self.rover = RoverEmulator(clock=lambda: self.now, **rover)  # type: ignore[arg-type]
        self.rover.connect(lambda frame: self.heard.extend(self._in.feed(frame, self.now)))

    def say(self, message: Message) -> None:
        self.rover.receive(self._out.encode(message), self.now)

    def run(self, seconds: float, each: Callable[[], None] | None = None) -> None:
        for _ in range(round(seconds / 0.02)):
            if each is not None:
                each()
            self.now += 0.02
            self.rover.step()

    def ask(self, message: Message, wait: float = 0.03) -> list[Message]:
        """What comes back."""
        self.heard.clear()
        self.say(message)
        self.run(wait)
        return list(self.heard)

    def command(self, command: int, *parameters: float) -> int:
        """Result of a COMMAND_LONG."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        answers = self.ask(dialect.MAVLink_command_long_message(1, 1, command, 0, *values))
        acks = [m for m in answers if m.get_type() == "COMMAND_ACK"]
        assert [(m.command, m.target_system, m.target_component) for m in acks] == [
            (command, 255, 190)
        ]
        return int(acks[0].result)

    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    def of(self, kind: str) -> list[Message]:
        return [m for m in self.heard if m.get_type() == kind]

    def guided(self) -> None:
        self.run(3.0)
        assert self.rover.pilot_mode(GUIDED)
        assert self.rover.pilot_arm()

    def set_point(
        self,
        v: float,
        rate: float,
        mask: int = 0x5C7,
        frame: int = 8,
        vy: float = 0.0,
        yaw: float = 0.0,
    ) -> None:
        rest = (0.0,) * 3
        self.say(
            dialect.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, *rest, v, vy, 0.0, *rest, yaw, rate
            )
        )

    def drive(self, v: float, rate: float, seconds: float, **more: float) -> tuple[float, float]:
        """Forward speed and turn rate (counter-clockwise) in the end."""
        self.run(seconds, lambda: self.set_point(v, rate, **more))  # type: ignore[arg-type]
        east, north, turn = self.rover.velocity
        theta = self.rover.pose[2]
        return east * math.cos(theta) + north * math.sin(theta), turn


class TestSetPoints:
    """Masks, frames, signs, limits and the time-out."""

    @pytest.mark.parametrize("frame", [1, 7, 8, 9])
    def test_velocity_and_yaw_rate(self, frame: int) -> None:
        ground = Ground()
        ground.guided()
        assert ground.drive(0.5, 0.3, 4.0, frame=frame) == pytest.approx((0.5, -0.3), abs=0.02)

    def test_the_sign_of_the_turn_is_the_same_in_reverse(self) -> None:
        ground = Ground()
        ground.guided()
        assert ground.drive(-0.5, 0.3, 4.0) == pytest.approx((-0.5, -0.3), abs=0.02)

    def test_the_speed_is_the_norm_of_the_velocity(self) -> None:
        ground = Ground()
        ground.guided()
        assert ground.drive(-0.3, 0.0, 4.0, vy=0.4)[0] == pytest.approx(-0.5, abs=0.02)

    def test_the_speed_is_clipped_to_wp_speed(self) -> None:
        ground = Ground(parameters={"WP_SPEED": 0.7})
        ground.guided()
        assert ground.drive(5.0, 0.0, 5.0)[0] == pytest.approx(0.7, abs=0.02)
        assert ground.drive(-5.0, 0.0, 6.0)[0] == pytest.approx(-0.7, abs=0.02)

    @pytest.mark.parametrize("mask", [0x5D7, 0x5CF, 0x5DF])
    def test_one_ignored_velocity_drops_both_but_not_the_turn(self, mask: int) -> None:
        ground = Ground()
        ground.guided()
        assert ground.drive(0.5, 0.3, 3.0, mask=mask) == pytest.approx((0.0, -0.3), abs=0.02)

    @pytest.mark.parametrize(
        ("mask", "frame"), [(0x5C7, 12), (0x5C7, 0), (0x407, 8), (0x1C7, 8), (0xDFF, 8), (0x5C4, 8)]
    )
    def test_frames_and_masks_that_are_ignored(self, mask: int, frame: int) -> None:
        """Other frames, accelerations in use, yaw and yaw rate at once, nothing at all, a
        position.
        """
        ground = Ground()
        ground.guided()
        assert ground.drive(0.5, 0.3, 1.0, mask=mask, frame=frame) == (0.0, 0.0)
        assert ground.rover.counters["set_points"] == 0
        assert ground.rover.counters["ignored_set_points"] == 50

    def test_velocity_alone_steers_to_its_direction(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.0, 0.0, 5.0, mask=0xDC7, frame=1, vy=0.5)
        assert ground.rover.pose[2] == pytest.approx(0.0, abs=0.02), "east"
        ground.drive(0.5, 0.0, 5.0, mask=0xDC7, frame=1)
        assert ground.rover.pose[2] == pytest.approx(math.pi / 2, abs=0.02), "north"

    def test_a_heading(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.3, 0.0, 5.0, mask=0x9C7, frame=1, yaw=math.pi)
        assert ground.rover.pose[2] == pytest.approx(-math.pi / 2, abs=0.02), "south"

    def test_set_points_that_stop_are_obeyed_for_three_seconds(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.5, 0.0, 5.0)
        start = ground.rover.pose[0]
        ground.run(2.9)
        assert ground.rover.velocity[0] == pytest.approx(0.5, abs=0.02)
        ground.run(3.0)
        assert ground.rover.stopped
        assert ground.rover.pose[0] - start == pytest.approx(1.7, abs=0.03)
        assert "target not received last 3.0 secs, stopping" in ground.texts()
        assert ground.rover.counters["timeouts"] == 1

    @pytest.mark.parametrize(("v", "rate"), [(math.nan, 0.0), (0.2, math.nan), (math.inf, 0.0)])
    def test_what_is_not_finite_is_reported_as_what_aborts_the_real_one(
        self, v: float, rate: float
    ) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.5, 0.0, 2.0)
        ground.set_point(v, rate)
        ground.run(2.0)
        assert ground.rover.counters["aborts"] == 1
        assert "set-point not finite: ArduPilot aborts here" in ground.texts()
        assert [m.severity for m in ground.of("STATUSTEXT") if "aborts" in m.text] == [0]
        assert ground.rover.stopped

    def test_never_acknowledged(self) -> None:
        ground = Ground()
        ground.guided()
        ground.heard.clear()
        ground.drive(0.5, 0.0, 1.0)
        assert not ground.of("COMMAND_ACK")

    @pytest.mark.parametrize("mode", [MANUAL, HOLD])
    def test_only_in_guided(self, mode: int) -> None:
        ground = Ground()
        ground.guided()
        ground.rover.pilot_mode(mode)
        assert ground.drive(0.5, 0.0, 1.0) == (0.0, 0.0)

    def test_not_before_there_is_an_origin(self) -> None:
        ground = Ground(parameters=MOTION_CAPTURE)
        ground.run(3.0)
        ground.rover.autopilot.mode = GUIDED
        ground.set_point(0.5, 0.0)
        ground.run(0.1)
        assert ground.rover.counters["ignored_set_points"] == 1

    def test_a_new_start_in_guided_forgets_the_last_set_point(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.5, 0.0, 1.0)
        ground.rover.pilot_mode(HOLD)
        ground.run(2.0)
        ground.rover.pilot_mode(GUIDED)
        ground.run(0.5)
        assert ground.rover.stopped


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

    def test_forced(self) -> None:
        ground = Ground(arm_after=30.0)
        assert ground.command(400, 1.0, 21196.0) == ACCEPTED

    def test_guided_needs_a_position(self) -> None:
        ground = Ground()
        assert ground.command(176, 1.0, GUIDED) == FAILED
        ground.run(3.0)
        assert ground.command(176, 1.0, GUIDED) == ACCEPTED
        assert ground.rover.mode == "GUIDED"

    @pytest.mark.parametrize("odd", [2.0, -1.0, math.nan])
    def test_neither_arm_nor_disarm(self, odd: float) -> None:
        ground = Ground()
        ground.run(3.0)
        assert ground.command(400, odd) in (UNSUPPORTED, DENIED)
        assert not ground.rover.armed


class TestModes:
    """Mode changes and what the heartbeat shows of them."""

    def test_a_change_is_shown_at_once(self) -> None:
        ground = Ground()
        ground.run(3.0)
        answers = ground.ask(
            dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, HOLD, 0, 0, 0, 0, 0)
        )
        beats = [m for m in answers if m.get_type() == "HEARTBEAT"]
        assert (
            beats[0].custom_mode,
            beats[0].base_mode & 1,
            beats[0].system_status,
            beats[0].type,
            beats[0].autopilot,
        ) == (4, 1, 3, 10, 3)

    def test_once_a_second_otherwise(self) -> None:
        ground = Ground()
        ground.run(10.5)
        assert len(ground.of("HEARTBEAT")) == 11, "at 0, 1, ... 10 s"

    def test_what_is_not_emulated_is_refused(self) -> None:
        ground = Ground()
        ground.run(3.0)
        for mode in (10, 11, 99):
            assert ground.command(176, 1.0, mode) == FAILED
        assert ground.command(176, 0.0, HOLD) == UNSUPPORTED
        assert ground.rover.mode == "MANUAL"

    def test_the_old_set_mode_message(self) -> None:
        ground = Ground()
        answers = ground.ask(dialect.MAVLink_set_mode_message(1, 1, HOLD))
        assert [(m.command, m.result) for m in answers if m.get_type() == "COMMAND_ACK"] == [
            (11, ACCEPTED)
        ]
        assert ground.rover.mode == "HOLD"

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


class TestTelemetry:
    """Requests, limits, and what is told."""

    @pytest.mark.parametrize(
        ("interval", "result"),
        [(25_000, ACCEPTED), (20_000, DENIED), (100, DENIED), (-1, ACCEPTED), (math.nan, DENIED)],
    )
    def test_at_most_forty_hertz(self, interval: float, result: int) -> None:
        assert Ground().command(511, 30.0, interval) == result

    def test_the_limit_follows_the_loop_rate(self) -> None:
        ground = Ground(parameters={"SCHED_LOOP_RATE": 100.0})
        assert ground.command(511, 30.0, 13_000.0) == ACCEPTED
        assert ground.command(511, 30.0, 12_000.0) == DENIED

    @pytest.mark.parametrize(("rate", "message"), [(40.0, 30), (10.0, 32), (4.0, 193), (1.0, 1)])
    def test_the_rate_is_kept(self, rate: float, message: int) -> None:
        ground = Ground()
        ground.run(3.0)
        assert ground.command(511, message, 1e6 / rate) == ACCEPTED
        ground.heard.clear()
        ground.run(10.0)
        assert sum(m.get_msgId() == message for m in ground.heard) == pytest.approx(
            10.0 * rate, abs=1.0
        )
        assert ground.command(511, message, -1.0) == ACCEPTED
        ground.heard.clear()
        ground.run(5.0)
        assert not [m for m in ground.heard if m.get_msgId() == message]

    def test_unknown_messages_are_refused(self) -> None:
        ground = Ground()
        assert ground.command(511, 331.0, 1e5) == FAILED, "ODOMETRY is input only"
        assert ground.command(512, 331.0) == FAILED

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

    def test_position_and_attitude_are_ned(self) -> None:
        ground = Ground(pose=(3.0, -2.0, 0.5))
        ground.guided()
        ground.drive(0.5, 0.2, 3.0)
        assert ground.command(512, 32.0) == ACCEPTED
        (told,) = ground.of("LOCAL_POSITION_NED")
        x, y, _ = ground.rover.pose
        east, north, _ = ground.rover.velocity
        assert (told.x, told.y, told.vx, told.vy) == pytest.approx((y, x, north, east), abs=0.04)
        assert ground.command(512, 30.0) == ACCEPTED
        (told,) = ground.of("ATTITUDE")
        assert told.yaw == pytest.approx(math.pi / 2 - ground.rover.pose[2], abs=0.01)
        assert told.yawspeed == pytest.approx(0.2, abs=0.01)

    def test_no_position_no_message_and_flags_that_say_so(self) -> None:
        ground = Ground(arm_after=10.0)
        ground.run(3.0)
        assert ground.command(512, 32.0) == FAILED
        ground.command(512, 193.0)
        assert ground.of("EKF_STATUS_REPORT")[0].flags & 24 == 0
        ground.run(10.0)
        assert ground.command(512, 32.0) == ACCEPTED
        ground.command(512, 193.0)
        assert ground.of("EKF_STATUS_REPORT")[0].flags & 24 == 24

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


class TestParameters:
    """PARAM_REQUEST_LIST, READ, SET."""

    def test_the_whole_list(self) -> None:
        answers = Ground().ask(dialect.MAVLink_param_request_list_message(1, 1), 1.0)
        values = [m for m in answers if m.get_type() == "PARAM_VALUE"]
        assert [(m.param_id, m.param_index, m.param_count) for m in values] == [
            (n, i, len(DEFAULTS)) for i, n in enumerate(DEFAULTS)
        ]
        assert {m.param_id: m.param_value for m in values} == {
            name: value for name, (value, _) in DEFAULTS.items()
        }

    def test_one_by_name_or_index(self) -> None:
        ground = Ground()
        for name, index in ((b"WP_SPEED", -1), (b"", list(DEFAULTS).index("WP_SPEED"))):
            (told,) = [
                m
                for m in ground.ask(dialect.MAVLink_param_request_read_message(1, 1, name, index))
                if m.get_type() == "PARAM_VALUE"
            ]
            assert (told.param_id, told.param_value) == ("WP_SPEED", 2.0)
        assert not [
            m
            for m in ground.ask(dialect.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
            if m.get_type() == "PARAM_VALUE"
        ]

    @pytest.mark.parametrize(
        ("name", "value", "then"),
        [(b"WP_SPEED", 0.8, 0.8), (b"FS_GCS_ENABLE", 1.0, 1.0), (b"FS_GCS_ENABLE", math.nan, 0.0)],
    )
    def test_set(self, name: bytes, value: float, then: float) -> None:
        ground = Ground()
        (told,) = [
            m
            for m in ground.ask(dialect.MAVLink_param_set_message(1, 1, name, value, 9))
            if m.get_type() == "PARAM_VALUE"
        ]
        assert told.param_value == pytest.approx(then)
        assert ground.rover.parameters[name.decode()] == pytest.approx(then)

    @pytest.mark.parametrize(
        ("name", "value"), [(b"SCHED_LOOP_RATE", 0.0), (b"WP_SPEED", -1.0), (b"WP_SPEED", 1e30)]
    )
    def test_values_out_of_range_change_nothing(self, name: bytes, value: float) -> None:
        ground = Ground()
        (told,) = [
            m
            for m in ground.ask(dialect.MAVLink_param_set_message(1, 1, name, value, 9))
            if m.get_type() == "PARAM_VALUE"
        ]
        assert told.param_value == DEFAULTS[name.decode()][0]

    def test_wrong_ones_at_the_border(self) -> None:
        for wrong in ({"NO_SUCH": 1.0}, {"WP_SPEED": math.nan}, {"SCHED_LOOP_RATE": 1.0}):
            with pytest.raises(ValueError, match="parameter "):
                RoverEmulator(parameters=wrong)


class TestFailsafes:
    """GCS and EKF."""

    def drive(self, system: int, kind: int = 6, **parameters: float) -> Ground:
        ground = Ground(system=system, parameters=parameters)
        ground.guided()
        beat = dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3)
        ground.run(2.0, lambda: ground.say(beat))
        ground.drive(0.3, 0.0, 10.0)
        return ground

    def test_off_as_delivered(self) -> None:
        assert self.drive(255).rover.mode == "GUIDED"

    def test_on_it_holds_when_its_ground_station_falls_silent(self) -> None:
        ground = self.drive(255, FS_GCS_ENABLE=1.0)
        assert ground.rover.mode == "HOLD"
        assert "GCS Failsafe" in ground.texts()
        assert ground.rover.stopped

    def test_it_counts_one_system_id_only(self) -> None:
        assert self.drive(254, FS_GCS_ENABLE=1.0).rover.mode == "GUIDED"
        assert self.drive(254, FS_GCS_ENABLE=1.0, SYSID_MYGCS=254.0).rover.mode == "HOLD"

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

    def test_too_slow_a_source_is_never_taken(self) -> None:
        ground = Ground(parameters=MOTION_CAPTURE)
        ground.say(dialect.MAVLink_set_gps_global_origin_message(1, 474000000, 85000000, 400000))
        for _ in range(10):
            ground.say(
                dialect.MAVLink_vision_position_estimate_message(0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.3)
            )
            ground.run(0.5)
        assert ground.command(176, 1.0, GUIDED) == FAILED

    def test_not_asked_for_not_taken(self) -> None:
        ground = Ground()
        ground.run(
            3.0,
            lambda: ground.say(
                dialect.MAVLink_vision_position_estimate_message(0, 9.0, 9.0, 0.0, 0.0, 0.0, 0.3)
            ),
        )
        assert ground.rover.autopilot.estimator.pose == ground.rover.pose


@pytest.mark.parametrize("enough", [100_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_frames_with_random_content(enough: int) -> None:
    """Right CRC, random payloads of every kind, some junk between.

    The rover answers or ignores, and goes on.
    """
    noise, ground = random.Random(5), Ground()
    ground.guided()
    kinds = [kind for kind in dialect.mavlink_map.values() if kind.unpacker.size]
    handled = [kind for kind in kinds if kind.msgname in ground.rover._protocol._handlers]
    assert len(handled) == len(ground.rover._protocol._handlers)
    size = 0
    while size < enough:
        chunk = bytearray()
        for _ in range(50):
            kind = noise.choice(handled if noise.random() < 0.7 else kinds)
            payload = bytearray(
                noise.choice(
                    (
                        noise.randbytes(kind.unpacker.size),
                        bytes(kind.unpacker.size),
                        b"\xff" * kind.unpacker.size,
                    )
                )
            )
            head = struct.pack("<BBBBBB", len(payload), 0, 0, 0, 255, 190) + kind.id.to_bytes(
                3, "little"
            )
            chunk += (
                b"\xfd"
                + head
                + payload
                + struct.pack("<H", crc16_mcrf4xx(head + payload + bytes((kind.crc_extra,))))
            )
            chunk += noise.randbytes(noise.choice((0, 0, 0, 30)))
        size += len(chunk)
        ground.heard.clear()
        ground.rover.receive(bytes(chunk), ground.now)
        ground.run(0.02)
        assert all(map(math.isfinite, (*ground.rover.pose, *ground.rover.velocity)))
    assert ground.rover.counters["frames_in"] > 0.008 * enough
    ground.run(10.0)
    assert ground.of("HEARTBEAT")


class TestOther:
    """What is not emulated is answered as the protocol says, not with silence."""

    def test_unknown_commands_are_unsupported(self) -> None:
        ground = Ground()
        for command in (22, 178, 183, 31010):
            assert ground.command(command, 1.0) == UNSUPPORTED

    def test_commands_with_integers(self) -> None:
        ground = Ground()
        ground.run(3.0)
        answers = ground.ask(
            dialect.MAVLink_command_int_message(1, 1, 0, 400, 0, 0, 1.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
        )
        assert [m.result for m in answers if m.get_type() == "COMMAND_ACK"] == [ACCEPTED]

    def test_missions(self) -> None:
        ground = Ground()
        (count,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_request_list_message(1, 1))
            if m.get_type() == "MISSION_COUNT"
        ]
        assert (count.count, count.target_system) == (0, 255)
        (ack,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_count_message(1, 1, 3))
            if m.get_type() == "MISSION_ACK"
        ]
        assert ack.type == dialect.MAV_MISSION_UNSUPPORTED
        (ack,) = [
            m
            for m in ground.ask(dialect.MAVLink_mission_clear_all_message(1, 1))
            if m.get_type() == "MISSION_ACK"
        ]
        assert ack.type == dialect.MAV_MISSION_ACCEPTED

    def test_file_transfer(self) -> None:
        payload = bytes((5, 0, 0, 4, 3, 0, 0, 0, 0, 0, 0, 0)) + b"abc"
        asked = dialect.MAVLink_file_transfer_protocol_message(
            0, 1, 1, tuple(payload.ljust(251, b"\0"))
        )
        (nak,) = [m for m in Ground().ask(asked) if m.get_type() == "FILE_TRANSFER_PROTOCOL"]
        assert tuple(nak.payload[:13]) == (6, 0, 0, 129, 1, 4, 0, 0, 0, 0, 0, 0, 7)

    def test_messages_for_other_vehicles_are_left_alone(self) -> None:
        ground = Ground()
        ground.run(3.0)
        answers = ground.ask(
            dialect.MAVLink_command_long_message(2, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        )
        assert not [m for m in answers if m.get_type() == "COMMAND_ACK"]
        assert not ground.rover.armed

    def test_a_reboot_forgets_all_but_the_parameters(self) -> None:
        ground = Ground()
        ground.guided()
        assert ground.command(246, 1.0) == FAILED, "not while armed"
        ground.rover.parameters.set("WP_SPEED", 1.5)
        ground.rover.pilot_arm(False)
        assert ground.command(246, 1.0) == ACCEPTED
        assert (ground.rover.reboots, ground.rover.mode, ground.rover.parameters["WP_SPEED"]) == (
            1,
            "MANUAL",
            1.5,
        )
        ground.run(0.1)
        assert not ground.rover.pilot_arm()

    def test_a_stall_of_the_emulator_is_not_made_up_for(self) -> None:
        ground = Ground()
        ground.guided()
        ground.drive(0.5, 0.0, 3.0)
        x = ground.rover.pose[0]
        ground.now += 100.0
        ground.heard.clear()
        ground.rover.step()
        assert ground.rover.pose[0] - x < 0.1
        assert len(ground.of("HEARTBEAT")) <= 1
