"""The driver against the emulated rover, on a clock of the tests' own."""

from __future__ import annotations

import math

import pytest
from mavlink_rig import Rig, dialect, other

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.emulator.rover.parameters import MOTION_CAPTURE


def error(rig: Rig) -> tuple[float, float]:
    """Distance and angle between the driver's state and the truth at its stamp, for a rover
    that is not accelerating.
    """
    state = rig.core.state
    assert state is not None
    x, y, theta = rig.rover.pose
    east, north, turn = rig.rover.velocity
    ago = rig.now - state.stamp
    return math.hypot(x - east * ago - state.x, y - north * ago - state.y), abs(
        math.remainder(theta - turn * ago - state.theta, math.tau)
    )


@pytest.mark.parametrize(
    ("theta", "v", "omega"),
    [
        (0.0, 0.5, 0.3),
        (1.0, -0.4, 0.3),
        (-2.5, 0.5, -0.3),
        (math.pi, 0.0, 0.5),
        (math.pi, -0.4, 0.3),
    ],
)
def test_what_we_command_is_what_moves_and_what_we_see(
    theta: float, v: float, omega: float
) -> None:
    rig = Rig(pose=(1.0, -2.0, theta))
    rig.take()
    rig.drive(v, omega, 4.0)
    state = rig.core.state
    assert state is not None
    assert state.v == pytest.approx(v, abs=0.02)
    assert state.omega == pytest.approx(omega, abs=0.02)
    assert -math.pi < state.theta <= math.pi
    distance, angle = error(rig)
    assert distance < 0.012 * abs(v) + 1e-3
    assert angle < 0.012 * abs(omega) + 1e-3
    east, north, turn = rig.rover.velocity
    heading = rig.rover.pose[2]
    assert (east * math.cos(heading) + north * math.sin(heading), turn) == pytest.approx(
        (v, omega), abs=0.02
    )


def test_stamps_are_the_vehicle_s_own_whatever_the_link_takes() -> None:
    rig = Rig(latency=0.08)
    rig.take()
    rig.drive(0.5, 0.0, 6.0)
    state = rig.core.state
    assert state is not None
    assert 0.08 <= rig.now - state.stamp <= 0.15
    # the truth at the stamp, up to the loop period that the vehicle adds to one way
    assert error(rig)[0] < 0.5 * 0.02


def test_time_boot_ms_wraps_while_driving() -> None:
    rig = Rig(uptime=2**32 / 1000.0 - 8.0)
    rig.take()
    ages = []
    rig.run(
        10.0,
        lambda: (
            rig.core.set_point(0.3, 0.0, rig.now),
            ages.append(rig.now - rig.core.state.stamp),
        ),
    )  # type: ignore[union-attr]
    assert rig.rover._telemetry.boot_ms < 10_000
    assert max(ages) < 0.1
    assert rig.core.counters["clock_jumps"] == 0


def test_telemetry_rates() -> None:
    rig = Rig(MavlinkOptions(rate=50.0))
    rig.run(5.0)
    stamps = set()
    rig.run(10.0, lambda: stamps.add(rig.core.state.stamp), 0.005)  # type: ignore[union-attr]
    assert 390 <= len(stamps) <= 410, "50 Hz is denied at the delivered loop rate, 40 Hz is given"
    fast = Rig(MavlinkOptions(rate=50.0), parameters={"SCHED_LOOP_RATE": 100.0})
    fast.run(5.0)
    stamps.clear()
    fast.run(10.0, lambda: stamps.add(fast.core.state.stamp), 0.005)  # type: ignore[union-attr]
    assert 490 <= len(stamps) <= 510


def test_telemetry_comes_back_after_a_reboot() -> None:
    rig = Rig()
    rig.take()
    rig.rover.pilot_arm(False)
    reboot = dialect.MAVLink_command_long_message(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0)
    rig.rover.receive(other(255, 1).encode(reboot), rig.now)
    rig.run(0.5)
    assert rig.rover.reboots == 1
    rig.run(6.0)
    state = rig.core.state
    assert state is not None
    assert rig.now - state.stamp < 0.1
    assert rig.core.counters["clock_jumps"] == 1
    assert not rig.ready


def test_heartbeats_go_out_once_a_second_after_an_eager_beginning() -> None:
    rig = Rig()
    rig.run(2.0)
    eager = len([f for _, f in rig.sent if f[7:10] == b"\0\0\0"])
    assert 4 <= eager <= 15, "ten a second until one was accepted"
    rig.sent.clear()
    rig.run(20.0)
    parser = dialect.MAVLink(None)
    beats = [
        m for m in (parser.decode(bytearray(f)) for _, f in rig.sent) if m.get_type() == "HEARTBEAT"
    ]
    assert 19 <= len(beats) <= 21
    assert {(m.type, m.autopilot, m.get_srcSystem(), m.get_srcComponent()) for m in beats} == {
        (6, 8, 255, 190)
    }
    companion = Rig(MavlinkOptions(role="companion"))
    companion.run(1.0)
    first = parser.decode(bytearray(companion.sent[0][1]))
    assert (first.type, first.get_srcSystem(), first.get_srcComponent()) == (18, 1, 191)


def test_the_gcs_failsafe_is_turned_on_and_then_stops_a_rover_that_hears_nothing() -> None:
    rig = Rig()
    rig.take()
    assert rig.core.failsafe.note == "GCS failsafe: on, watches us"
    assert rig.rover.parameters["FS_GCS_ENABLE"] == 1.0
    rig.drive(0.4, 0.0, 2.0)
    rig.to_rover = lambda frame: []
    rig.run(3.5)
    assert rig.rover.mode == "GUIDED"
    rig.run(4.0)
    assert rig.rover.mode == "HOLD"


@pytest.mark.parametrize(
    ("options", "parameters", "note"),
    [
        (MavlinkOptions(failsafe=False), {}, "GCS failsafe: off (FS_GCS_ENABLE 0)"),
        (
            MavlinkOptions(role="companion"),
            {},
            "GCS failsafe: watches system 255 (SYSID_MYGCS), not us (1)",
        ),
        (
            MavlinkOptions(),
            {"SYSID_MYGCS": 254.0},
            "GCS failsafe: watches system 254 (SYSID_MYGCS), not us (255)",
        ),
    ],
)
def test_what_the_gcs_failsafe_does_not_cover_is_said(
    options: MavlinkOptions, parameters: dict[str, float], note: str
) -> None:
    rig = Rig(options, parameters=parameters)
    rig.run(5.0)
    assert rig.core.failsafe.note.startswith(note)
    assert rig.rover.parameters["FS_GCS_ENABLE"] == float(options.failsafe)


def test_parameters_that_never_come_are_not_asked_for_ever() -> None:
    rig = Rig()
    rig.to_core = lambda frame: [] if frame[7] == 22 else [frame]
    rig.run(20.0)
    parser = dialect.MAVLink(None)
    asked = [
        m
        for m in (parser.decode(bytearray(f)) for _, f in rig.sent)
        if m.get_type() == "PARAM_REQUEST_READ"
    ]
    assert len(asked) == 10
    assert rig.core.failsafe.note.endswith("no answer")


class TestOthers:
    """Only the configured system and component are obeyed."""

    def rig(self) -> Rig:
        rig = Rig()
        rig.take()
        rig.drive(0.3, 0.0, 1.0)
        return rig

    @pytest.mark.parametrize(("system", "component"), [(2, 1), (1, 100), (255, 190)])
    def test_others_are_counted_and_ignored(self, system: int, component: int) -> None:
        rig = self.rig()
        stranger, before = other(system, component), rig.core.state
        for message in (
            dialect.MAVLink_heartbeat_message(10, 3, 1, 0, 4, 3),
            dialect.MAVLink_local_position_ned_message(5000, 9.0, 9.0, 0.0, 0.0, 0.0, 0.0),
            dialect.MAVLink_ekf_status_report_message(0, 0.0, 0.0, 0.0, 0.0, 0.0),
            dialect.MAVLink_command_ack_message(176, 0),
            dialect.MAVLink_timesync_message(5, 5),
        ):
            rig.core.receive(stranger.encode(message), rig.now)
        assert rig.core.counters["others"] == 5
        assert rig.core.state is before
        assert rig.ready
        assert rig.faults == ()

    def test_another_master_is_a_fault(self) -> None:
        rig = self.rig()
        theirs = dialect.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 8, 0x5C7, *[0.0] * 11
        )
        rig.core.receive(other(254, 191).encode(theirs), rig.now)
        assert rig.faults == ("another master: system 254 sends set-points to the vehicle",)
        assert rig.core.counters["other_masters"] == 1
        rig.run(1.1)
        assert rig.faults == ()

    @pytest.mark.parametrize(("autopilot", "kind"), [(12, 10), (3, 2), (8, 6)])
    def test_what_is_no_ardupilot_rover_is_not_driven(self, autopilot: int, kind: int) -> None:
        rig = Rig()
        rig.core.receive(
            other(1).encode(dialect.MAVLink_heartbeat_message(kind, autopilot, 0x81, 15, 4, 3)),
            rig.now,
        )
        rig.core.tick(rig.now)
        rig.core.set_point(0.5, 0.0, rig.now)
        assert rig.core.counters["held_back"] == 1
        assert len(rig.sent) == 1, "our heartbeat only"
        assert f"autopilot {autopilot}, type {kind}" in rig.core.wrong_vehicle


class TestEstimate:
    """When the pose is not to be trusted."""

    def test_ekf_flags(self) -> None:
        rig = Rig()
        rig.take()
        assert rig.core.status(rig.now, True).pose_ok
        rig.rover.lose_position()
        took = rig.until(lambda: not rig.core.status(rig.now, True).pose_ok, 1.0)
        assert took <= 0.1
        assert "EKF: no horizontal position" in rig.faults

    @pytest.mark.parametrize(
        ("flags", "fault"),
        [
            (0x33F & ~1, "EKF: no attitude"),
            (0x33F & ~2, "EKF: no horizontal velocity"),
            (0x33F & ~24, "EKF: no horizontal position"),
            (0x33F | 128, "EKF: position held constant"),
            (0x33F | 1024, "EKF: not initialised"),
            (0x33F | 32768, "EKF: GPS glitch"),
        ],
    )
    def test_each_flag(self, flags: int, fault: str) -> None:
        rig = Rig()
        rig.take()
        rig.core.receive(
            other(1).encode(
                dialect.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)
            ),
            rig.now,
        )
        status = rig.core.status(rig.now, True)
        assert (status.pose_ok, status.faults) == (False, (fault,))

    def test_relative_position_is_enough(self) -> None:
        rig = Rig()
        rig.take()
        rig.core.receive(
            other(1).encode(
                dialect.MAVLink_ekf_status_report_message(1 | 2 | 8, 0.0, 0.0, 0.0, 0.0, 0.0)
            ),
            rig.now,
        )
        assert rig.core.status(rig.now, True).pose_ok

    def test_flags_that_stop_coming_are_not_believed(self) -> None:
        rig = Rig()
        rig.take()
        rig.to_core = lambda frame: [] if frame[7] == 193 else [frame]
        took = rig.until(lambda: not rig.core.status(rig.now, True).pose_ok, 1.0)
        assert took <= 0.3

    @pytest.mark.parametrize("field", range(6))
    def test_telemetry_that_cannot_be_is_refused(self, field: int) -> None:
        rig = Rig()
        rig.take()
        for count, bad in enumerate((math.nan, math.inf, -math.inf, 1e6), start=1):
            self.refuses(rig, field, bad, count)

    def refuses(self, rig: Rig, field: int, bad: float, count: int) -> None:
        before = rig.core.state
        values = [1.0, 2.0, 0.1, 0.2, 0.3, 0.1]
        values[field] = bad
        x, y, vx, vy, yaw, rate = values
        boot = rig.rover._telemetry.boot_ms
        rig.core.receive(
            other(1).encode(dialect.MAVLink_attitude_message(boot, 0.0, 0.0, yaw, 0.0, 0.0, rate)),
            rig.now,
        )
        rig.core.receive(
            other(1).encode(
                dialect.MAVLink_local_position_ned_message(boot, x, y, 0.0, vx, vy, 0.0)
            ),
            rig.now,
        )
        assert rig.core.counters["refused_telemetry"] == count
        state = rig.core.state
        assert state is not None
        assert all(map(math.isfinite, (state.x, state.y, state.theta, state.v, state.omega)))
        if field < 4:
            assert state is before

    def test_a_position_without_a_recent_attitude_is_no_pose(self) -> None:
        rig = Rig()
        rig.take()
        rig.to_core = lambda frame: [] if frame[7] == 30 else [frame]
        rig.run(1.0)
        state = rig.core.state
        assert state is not None
        assert 0.7 < rig.now - state.stamp <= 1.0
        assert rig.core.counters["unpaired_positions"] > 20

    def test_pose_stamps_grow_old_when_the_link_is_silent(self) -> None:
        rig = Rig()
        rig.take()
        rig.to_core = lambda frame: []
        rig.run(1.0)
        status = rig.core.status(rig.now, True)
        assert rig.now - status.pose_stamp > 0.9
        assert rig.now - status.heartbeat_stamp > 0.9


class TestMotionCapture:
    """A pose from outside, through the vehicle's filter."""

    ORIGIN = (47.4, 8.5, 400.0)

    def rig(self) -> Rig:
        options = MavlinkOptions(pose="mocap", origin=self.ORIGIN)
        return Rig(options, parameters=MOTION_CAPTURE, pose=(2.0, 1.0, 0.7))

    def feed(self, rig: Rig) -> None:
        rig.core.feed_pose(*rig.rover.pose, rig.now, rig.now)

    def test_no_origin_no_set_points(self) -> None:
        rig = Rig(MavlinkOptions(pose="mocap"), parameters=MOTION_CAPTURE)
        rig.run(5.0, lambda: self.feed(rig))
        assert not rig.rover.pilot_mode(15)
        assert rig.core.state is None

    def test_what_is_fed_comes_back_as_the_state(self) -> None:
        rig = self.rig()
        rig.run(4.0, lambda: self.feed(rig))
        state = rig.core.state
        assert state is not None
        assert (state.x, state.y, state.theta) == pytest.approx((2.0, 1.0, 0.7), abs=1e-5)
        rig.core.take(rig.now)
        rig.run(4.0, lambda: self.feed(rig))
        assert rig.ready
        rig.run(4.0, lambda: (self.feed(rig), rig.core.set_point(0.4, 0.3, rig.now)))
        distance, angle = error(rig)
        assert distance < 0.02
        assert angle < 0.02

    def test_freshness_is_judged_by_the_source(self) -> None:
        rig = self.rig()
        rig.run(6.0, lambda: self.feed(rig))
        lost = rig.now
        rig.run(6.5)
        status, state = rig.core.status(rig.now, True), rig.core.state
        assert state is not None
        assert rig.now - state.stamp < 0.1, "the vehicle's own output looks as valid as ever"
        assert status.pose_ok
        assert lost - 0.03 <= status.pose_stamp <= lost
        rig.run(1.0)
        assert not rig.core.status(rig.now, True).pose_ok
        assert rig.now - rig.core.state.stamp > 0.3  # type: ignore[union-attr]

    def test_the_vehicle_s_silence_counts_too(self) -> None:
        rig = self.rig()
        rig.run(6.0, lambda: self.feed(rig))
        rig.to_core = lambda frame: []
        rig.run(1.0, lambda: self.feed(rig))
        assert rig.now - rig.core.status(rig.now, True).pose_stamp > 0.9

    def test_bad_poses_are_refused(self) -> None:
        rig = self.rig()
        rig.run(2.0, lambda: self.feed(rig))
        before, now = len(rig.sent), rig.now
        for x, y, theta, stamp in (
            (math.nan, 0.0, 0.0, now),
            (0.0, math.inf, 0.0, now),
            (0.0, 0.0, math.nan, now),
            (0.0, 0.0, 0.0, math.nan),
            (0.0, 0.0, 0.0, now + 1.0),
            (0.0, 0.0, 0.0, now - 10.0),
        ):
            rig.core.feed_pose(x, y, theta, stamp, now)
        assert rig.core.counters["refused_poses"] == 6
        assert len(rig.sent) == before

    def test_a_fast_source_does_not_fill_the_link(self) -> None:
        rig = self.rig()
        rig.run(2.0, lambda: self.feed(rig), 0.005)
        assert 80 <= sum(frame[7] == 102 for _, frame in rig.sent) <= 101


@pytest.mark.parametrize(
    ("v", "omega"), [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)]
)
def test_what_is_not_finite_never_reaches_the_wire(v: float, omega: float) -> None:
    rig = Rig()
    rig.take()
    before = len(rig.sent)
    with pytest.raises(ValueError, match="finite"):
        rig.core.set_point(v, omega, rig.now)
    assert len(rig.sent) == before


def test_zeros_always_go_out() -> None:
    rig = Rig()
    rig.core.set_point(0.0, 0.0, rig.now)
    rig.core.set_point(0.1, 0.0, rig.now)
    assert [frame[7] for _, frame in rig.sent] == [84]
    assert rig.core.counters["held_back"] == 1
