"""When the driver trusts the pose that the vehicle tells, and when it does not."""

import math

import pytest
from mavlink_rig import Rig, dialect, other


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
