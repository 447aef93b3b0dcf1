"""When the driver trusts the pose that the vehicle tells, and when it does not."""

from __future__ import annotations

import math

import pytest
from mavlink_rig import Rig, dialect, error, other

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from kmpc_lab.emulator.rover.estimator import MOTION_CAPTURE


class TestEstimate:
    """When the pose is not to be trusted."""

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

    def test_poses_that_are_no_numbers_are_reported_as_such(self) -> None:
        rig = Rig()
        rig.take()
        word = "the autopilot sends poses that are no numbers, or impossible ones"
        tracker = rig.core.pose
        assert word not in rig.faults
        nan, stamp = math.nan, tracker.state.stamp
        for k in range(1, 20):
            later = stamp + 0.025 * k
            message = dialect.MAVLink_local_position_ned_message(0, nan, nan, 0.0, 0.0, 0.0, 0.0)
            tracker.on_position(message, later)
            tracker.on_ekf(0x33F, later)
            assert (word in tracker.faults(later, 20.0)) == (0.025 * k > 0.25 + 1e-9)
        rig.run(0.5)
        assert word not in rig.faults


class TestMotionCapture:
    """A pose from outside, through the vehicle's filter."""

    ORIGIN = (47.4, 8.5, 400.0)

    def rig(self) -> Rig:
        options = MavlinkOptions(pose="mocap", origin=self.ORIGIN)
        return Rig(options, parameters=MOTION_CAPTURE, pose=(2.0, 1.0, 0.7))

    def feed(self, rig: Rig) -> None:
        rig.core.feed_pose(*rig.rover.pose, rig.now, rig.now)

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
