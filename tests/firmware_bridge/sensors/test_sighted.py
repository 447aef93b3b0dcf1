"""A driver with eyes: its status tells the age of the scans, and what is wrong with them."""

import numpy as np
import pytest

from firmware_bridge.messages import LinkError, LinkStatus, State
from firmware_bridge.sensors.lidar.lidar import LidarHealth
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.sight import Sweep
from firmware_bridge.sensors.sighted import SightedDriver

OPTIONS = LidarOptions("ld06", "pty:x")


class Board:
    """A driver that notes what is done with it."""

    def __init__(self, log):
        self.log = log
        self.send = self.stop = lambda *args: None

    def connect(self, timeout):
        self.log.append(("board", timeout))

    def close(self):
        self.log.append(("board", "closed"))

    def state(self):
        return None

    def health(self):
        return LinkStatus(True, 1.0, 1.0, True, counters={"frames": 1})


class Eye:
    """A lidar of which a test tells what it sees."""

    def __init__(self, log, fails=False):
        self.log, self.fails, self.seen, self.faults = log, fails, None, ()

    def connect(self, timeout):
        self.log.append(("lidar", timeout))
        if self.fails:
            raise LinkError("lidar: no turn")

    def sweep(self):
        return self.seen

    def health(self):
        return LidarHealth(True, "an eye", 10.0, self.faults, {"turns": 7})

    def close(self):
        self.log.append(("lidar", "closed"))


def turn(stamp, unknown=0.0):
    ranges = np.where(np.arange(100) < 100 * unknown, np.nan, 2.0)
    return Sweep(np.linspace(0.0, 6.2, 100), ranges, np.full(100, stamp), 0.1, 8.0)


def pair(options=OPTIONS, **how):
    log = []
    eye = Eye(log, **how)
    return SightedDriver(Board(log), eye, options), eye, log


def test_a_robot_that_cannot_see_is_not_taken():
    driver, _, log = pair(fails=True)
    with pytest.raises(LinkError):
        driver.connect(3.0)
    assert log == [("lidar", OPTIONS.timeout)]
    driver, _, log = pair()
    driver.connect(3.0)
    driver.close()
    assert log[1:] == [("board", 3.0), ("board", "closed"), ("lidar", "closed")]


def test_a_covered_lidar_is_blind():
    driver, eye, _ = pair()
    eye.seen = turn(5.0)
    driver.sweep()
    eye.seen = turn(6.0, unknown=0.97)
    status = driver.health()
    assert status.scan_stamp == 5.0 and "only 3 % of its beams" in status.scan_faults[0]
    eye.seen = turn(7.0, unknown=0.5)
    assert driver.health().scan_stamp == 7.0 and not driver.health().scan_faults
    driver, eye, _ = pair(LidarOptions("ld06", "pty:x", no_return="free"))
    eye.seen = turn(6.0, unknown=0.97)
    assert driver.health().scan_stamp == 6.0


def hall(stamp, shift=0.0):
    """A turn in which no two beams are alike."""
    ranges = np.round(2.0 + shift + np.linspace(0.0, 1.0, 100), 3)
    return Sweep(np.linspace(0.0, 6.2, 100), ranges, np.full(100, stamp), 0.1, 8.0)


@pytest.mark.parametrize("way", [(0.3, 0.0), (0.0, 0.5)], ids=["drives", "turns"])
def test_turns_that_repeat_each_other_while_the_robot_moves_are_no_scans(way):
    driver, eye, _ = pair()
    for k in range(20):
        here = State(way[0] * 0.1 * k, 0.0, way[1] * 0.1 * k, *way, 0.1 * k)
        driver.inner.state = lambda here=here: here
        eye.seen = hall(0.1 * k)
        status = driver.health()
    assert status.scan_stamp < 0.5, "what came first was seen, and what is the same was not"
    assert any("repeat each other" in fault for fault in status.scan_faults)
    assert driver.sweep().stamp == status.scan_stamp
    eye.seen = hall(2.0, shift=0.001)
    assert driver.health().scan_stamp == 2.0 and driver.health().scan_faults == ()


def test_a_robot_that_stands_or_sees_next_to_nothing_may_see_the_same_again():
    driver, eye, _ = pair()
    for k in range(20):
        driver.inner.state = lambda k=k: State(0.001 * (k % 2), 0.0, 0.0, 0.0, 0.0, 0.1 * k)
        eye.seen = hall(0.1 * k)
        assert driver.health().scan_stamp == pytest.approx(0.1 * k)
    for k in range(20, 40):
        driver.inner.state = lambda k=k: State(0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.1 * k)
        eye.seen = turn(0.1 * k)
        assert driver.health().scan_stamp == pytest.approx(0.1 * k)
