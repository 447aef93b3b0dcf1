"""Poses from outside: what is believed, and what is refused."""

import math
import random

import pytest

from firmware_bridge.sensors.pose import RESTARTS, SETTLED, STEADY, PoseFilter, parse_pose

PERIOD = 0.02


def line(stamp, x=0.0, y=0.0, theta=0.0) -> bytes:
    return f"{stamp:.6f} {x:.6f} {y:.6f} {theta:.6f}".encode()


def fed(source=None, count=50, start=100.0, ahead=7000.0):
    """A filter that has heard a robot at rest for `count` periods, from a clock `ahead` of
    ours; and the time now.
    """
    source = PoseFilter() if source is None else source
    for k in range(count):
        now = start + k * PERIOD
        assert source.take(line(now + ahead), now) is not None
    return source, now


@pytest.mark.parametrize(
    "text",
    [
        b"1.5 2 -3 0.25",
        b"1.5,2,-3,0.25\n",
        b" 1.5, 2.0\t-3e0 .25\r\n",
        b'{"stamp": 1.5, "x": 2, "y": -3, "theta": 0.25}',
        b'{"theta": 0.25, "frame": "world", "y": -3.0, "x": 2.0, "stamp": 1.5}',
    ],
)
def test_a_pose_is_a_line_of_text_or_json(text):
    assert parse_pose(text) == (2.0, -3.0, 0.25, 1.5)


@pytest.mark.parametrize(
    ("datagram", "counter"),
    [
        (b"", "malformed"),
        (b'{"stamp": 1, "x": 2, "y": 3}', "malformed"),
        (b'{"stamp": 1, "x": 2, "y": 3, "theta": "4"}', "malformed"),
        (b'{"stamp": 1, "x": 1' + b"0" * 400 + b', "y": 3, "theta": 4}', "malformed"),
        (b"1 2 3 4" + b" " * 600, "malformed"),
    ],
)
def test_what_is_no_pose_is_counted_and_changes_nothing(datagram, counter):
    source, now = fed()
    before = source.latest, source.counters[counter]
    assert source.take(datagram, now + 0.01) is None
    assert (source.latest, source.counters[counter]) == (before[0], before[1] + 1)
    assert source.take(line(now + PERIOD + 7000.0), now + PERIOD) is not None


def test_overtaken_and_repeated_poses_are_refused():
    source, now = fed()
    assert source.take(line(now + 7000.0), now + 0.01) is None
    assert source.take(line(now - 0.1 + 7000.0), now + 0.02) is None
    assert source.counters["out_of_order"] == 2


@pytest.mark.parametrize("step", [-5000.0, 5000.0, 1e9])
def test_a_source_whose_clock_jumps_is_believed_anew_with_stamps_that_go_on(step):
    source, now = fed()
    stamps = [source.latest.stamp]
    for k in range(1, 50):
        pose = source.take(line(now + k * PERIOD + 7000.0 + step), now + k * PERIOD)
        assert pose is not None and abs(pose.stamp - now - k * PERIOD) < 0.01
        stamps.append(pose.stamp)
    assert source.counters["clock_jumps"] == 1 and all(
        b > a for a, b in zip(stamps, stamps[1:], strict=False)
    )


@pytest.mark.parametrize("hop", [2.0, -2.0, 500.0])
def test_stamps_that_hop_to_and_fro_are_a_fault_and_not_believed(hop):
    """Each hop begins the age anew: all of them were believed, however old they were."""
    source, now = fed()
    at, believed = now, 0
    for k in range(1, 200):
        at = now + k * PERIOD
        believed += source.take(line(at + 7000.0 + hop * (k // 5 % 2)), at) is not None
    assert believed <= 5 * (RESTARTS + 1) and source.counters["unsteady"] > 150
    assert "clock of the pose source jumps" in source.fault(at)
    begin = at = at + PERIOD
    while source.take(line(at + 7000.0), at) is None:
        at += PERIOD
        assert at - begin < 2 * STEADY
    assert at - begin > 0.8 * STEADY, "steady again, it is believed again"


def test_a_jump_is_refused_until_the_robot_stays_there():
    source, now = fed()
    for k in range(1, 4):
        assert source.take(line(now + k * PERIOD + 7000.0, x=2.0), now + k * PERIOD) is None
    # exchanged markers, and back again
    assert source.take(line(now + 4 * PERIOD + 7000.0), now + 4 * PERIOD) is not None
    assert source.counters["jumps"] == 3
    now += 4 * PERIOD
    # carried away: by the time it is believed again the gate has stopped the robot
    believed = [
        source.take(line(now + k * PERIOD + 7000.0, x=4.0, theta=2.0), now + k * PERIOD)
        for k in range(1, 60)
    ]
    first = next(k for k, pose in enumerate(believed, 1) if pose is not None)
    assert (
        first * PERIOD == pytest.approx(SETTLED + PERIOD, abs=0.5 * PERIOD)
        and None not in believed[first:]
    )


def test_noise_of_any_kind_raises_nothing():
    chance, source, now = random.Random(5), PoseFilter(), 50.0
    good = 0
    for _ in range(20_000):
        now += chance.uniform(0.0, 0.03)
        text = bytearray(line(now + 3.0, 0.1, 0.2, 0.3))
        if chance.random() < 0.5:
            for _ in range(chance.randrange(1, 6)):
                text[chance.randrange(len(text))] = chance.randrange(256)
        pose = source.take(bytes(text), now)
        if pose is not None:
            good += 1
            assert all(map(math.isfinite, pose)) and pose.stamp <= now
    counts = source.counters
    # half of all stamps are damaged: a clock like that is a fault, and not to be believed
    assert good == counts["poses"] > 0 and good + counts["unsteady"] > 9000
    assert counts["malformed"] > 1000
    refused = ("malformed", "not_finite", "out_of_order", "jumps", "unsteady")
    assert good + sum(counts[name] for name in refused) == 20_000


@pytest.mark.parametrize("words", ["nan 2 3", "1 2 inf", "1e9 2 3"])
def test_a_source_that_sends_no_numbers_is_reported_as_such(words):
    """It was reported as "no pose, or too old", as one that sends nothing."""
    source, now = fed()
    assert source.nonsense(now) == ""
    for _ in range(40):
        now += PERIOD
        source.take(f"{now + 7000.0} {words}".encode(), now)
    assert source.nonsense(now).startswith("the pose source sends non-finite numbers")
    assert source.nonsense(now + 5.0) == "", "it sends nothing now"
    source.take(line(now + 7000.01), now + 0.01)
    assert source.nonsense(now + 0.01) == ""
    mute = PoseFilter()
    mute.take(b"1 nan 2 3", 5.0)
    assert mute.nonsense(5.1)
