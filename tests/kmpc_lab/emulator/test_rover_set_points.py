"""What the emulated rover makes of set-points: masks, frames, signs, limits and the time-out."""

import math

import pytest
from ground_station import Ground


class TestSetPoints:
    """Masks, frames, signs, limits and the time-out."""

    @pytest.mark.parametrize("frame", [1, 7, 8, 9])
    def test_velocity_and_yaw_rate(self, frame: int) -> None:
        ground = Ground()
        ground.guided()
        assert ground.drive(0.5, 0.3, 4.0, frame=frame) == pytest.approx((0.5, -0.3), abs=0.02)

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
