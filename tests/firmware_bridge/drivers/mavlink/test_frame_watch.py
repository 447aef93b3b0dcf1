"""After a restart of the autopilot, or another origin, nothing moves until somebody has looked."""

from __future__ import annotations

import pytest
from mavlink_rig import Rig

from firmware_bridge.drivers.mavlink.telemetry import FrameWatch


def reboot(rig: Rig, east: float) -> None:
    """Restart the rover as the real one does: its origin is where it stands then."""
    x, y, theta = rig.rover.pose
    rig.rover._boot(0.0)
    rig.rover.place(x - east, y, theta)


def test_a_restart_is_told_and_keeps_being_told() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.3, 0.0, 2.0)
    assert rig.core.status(rig.now, True).frame_doubt == ""
    reboot(rig, 3.0)
    rig.run(5.0)
    assert "was restarted" in rig.core.status(rig.now, True).frame_doubt
    rig.core.take(rig.now)
    rig.run(20.0)
    assert "was restarted" in rig.core.status(rig.now, True).frame_doubt
    rig.core.confirm_frame()
    rig.run(5.0)
    assert rig.core.status(rig.now, True).frame_doubt == ""
    assert rig.core.counters["frame_doubts"] == 1


def test_an_origin_that_another_station_moves_is_told() -> None:
    rig = Rig()
    rig.take()
    rig.run(3.0)
    latitude, longitude, altitude = rig.rover.autopilot.estimator.origin
    rig.rover.autopilot.estimator.origin = (latitude + 1e-5, longitude, altitude)
    rig.until(lambda: "origin has moved" in rig.core.status(rig.now, True).frame_doubt, 3.0)


def test_a_clock_that_wraps_or_drifts_is_no_restart() -> None:
    rig = Rig(uptime=2.0**32 / 1000.0 - 3.0)
    rig.take()
    rig.run(20.0)
    assert rig.core.status(rig.now, True).frame_doubt == ""


@pytest.mark.parametrize(("moved", "doubted"), [(0, False), (10, False), (11, True), (-50, True)])
def test_origins_that_agree(moved: int, doubted: bool) -> None:
    watch = FrameWatch()
    watch.on_origin(473769000, 85417000)
    watch.on_origin(473769000 + moved, 85417000)
    assert bool(watch.doubt) is doubted
