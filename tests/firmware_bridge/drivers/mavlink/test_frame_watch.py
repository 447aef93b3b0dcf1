"""After a restart of the autopilot, or another origin, nothing moves until it is confirmed."""

from mavlink_rig import Rig


def reboot(rig: Rig, east: float) -> None:
    """Restart the rover as the real one does: its origin is where it stands then."""
    x, y, theta = rig.rover.pose
    rig.rover._boot(0.0)
    rig.rover.place(x - east, y, theta)


def test_a_restart_is_reported_and_stays_reported() -> None:
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


def test_an_origin_that_another_station_moves_is_reported() -> None:
    rig = Rig()
    rig.take()
    rig.run(3.0)
    latitude, longitude, altitude = rig.rover.autopilot.estimator.origin
    rig.rover.autopilot.estimator.origin = (latitude + 1e-5, longitude, altitude)
    rig.until(lambda: "origin has moved" in rig.core.status(rig.now, True).frame_doubt, 3.0)
