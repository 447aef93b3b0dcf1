"""Poses from outside through the vehicle's filter: what is fed, refused, and how old it is."""

import math

import pytest
from mavlink_rig import Rig, error

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from kmpc_lab.emulator.rover.estimator import MOTION_CAPTURE


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
