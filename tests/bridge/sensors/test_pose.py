"""Poses from outside: what is believed, what is refused, and robots that drive by them."""

import json
import math
import random
import socket

import pytest
from boards import TABLES, until
from boards import Rig as BoardRig
from courses import COURSE, PATIENT

from firmware_bridge.emulator.mocap import MocapOptions, MocapSender
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.sensors.pose import (
    COUNTERS,
    RESTARTS,
    SETTLED,
    STEADY,
    PosedDriver,
    PoseFilter,
    parse_pose,
)

PERIOD = 0.02


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


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
        (b"1 2 3", "malformed"),
        (b"1 2 3 4 5", "malformed"),
        (b"one 2 3 4", "malformed"),
        (b"\xff\xfe\x00", "malformed"),
        (b"1.0 2.0 3.0 0x4", "malformed"),
        (b'{"stamp": 1, "x": 2, "y": 3}', "malformed"),
        (b'{"stamp": 1, "x": 2, "y": 3, "theta": "4"}', "malformed"),
        (b'{"stamp": true, "x": 2, "y": 3, "theta": 4}', "malformed"),
        (b'{"stamp": 1, "x": 1' + b"0" * 400 + b', "y": 3, "theta": 4}', "malformed"),
        (b'{"a":' * 90, "malformed"),
        (b"1 2 3 4" + b" " * 600, "malformed"),
        (b"101 nan 3 4", "not_finite"),
        (b"101 2 inf 4", "not_finite"),
        (b"nan 2 3 4", "not_finite"),
        (b"101 2 1e9 4", "not_finite"),
        (b'{"stamp": 101, "x": NaN, "y": 3, "theta": 4}', "not_finite"),
    ],
)
def test_what_is_no_pose_is_counted_and_changes_nothing(datagram, counter):
    source, now = fed()
    before = source.latest, source.counters[counter]
    assert source.take(datagram, now + 0.01) is None
    assert (source.latest, source.counters[counter]) == (before[0], before[1] + 1)
    assert source.take(line(now + PERIOD + 7000.0), now + PERIOD) is not None


def test_a_pose_that_waited_on_the_way_is_told_by_its_age():
    source, now = fed()
    late = source.take(line(now + PERIOD + 7000.0), now + PERIOD + 0.4)
    assert late.stamp == pytest.approx(now + PERIOD, abs=1e-5)
    assert source.counters["silences"] == 1


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


def test_a_clock_that_drifts_does_not_make_poses_old():
    source, now = fed()
    worst = 0.0
    for k in range(1, 5000):
        at = now + k * PERIOD
        pose = source.take(line((at - now) * (1.0 - 1e-3) + now + 7000.0), at)
        worst = max(worst, at - pose.stamp)
    # a millisecond a second, looked at for ten
    assert worst < 0.0121


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


def test_a_heading_that_jumps_is_refused_and_one_that_wraps_is_not():
    source, now = fed()
    assert source.take(line(now + PERIOD + 7000.0, theta=2.0), now + PERIOD) is None
    source = PoseFilter()
    for k in range(200):
        now = 100.0 + k * PERIOD
        assert (
            source.take(line(now, theta=math.remainder(3.0 + k * PERIOD, math.tau)), now)
            is not None
        )
    assert source.counters["jumps"] == 0


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


def posed(port, name="roboclaw", **more):
    """A driver of a board's robot file, with poses at a port."""
    table = {
        **TABLES[name],
        "link": {"url": more.pop("url"), "driver": name, "pose": f"udp:127.0.0.1:{port}"},
    }
    robot = load_robot(None, table)
    return open_driver(robot, open_transport(robot.link.url))


def test_a_board_drives_by_the_pose_of_the_source_and_not_by_its_wheels(tmp_path):
    port, url = free_port(), f"pty:{tmp_path}/link"
    rig = BoardRig("roboclaw", url, slip=0.3, turn_gain=0.6)
    rig.emulator.place(2.0, -1.0, 0.5)
    camera = MocapSender(
        lambda: rig.emulator.pose,
        f"udp:127.0.0.1:{port}",
        options=MocapOptions(rate=100.0, noise=0.0, heading_noise=0.0),
    )
    driver = posed(port, url=url)
    assert isinstance(driver, PosedDriver)
    try:
        driver.connect(20.0)
        assert driver.state() is None and driver.health().pose_stamp == -math.inf
        camera.start()
        assert until(lambda: driver.state() is not None)

        def driven() -> bool:
            driver.send(0.3, 0.5)
            x, y, _ = rig.emulator.pose
            as_told = abs(driver.state().v - 0.3) < 0.05
            return as_told and math.hypot(x - 2.0, y + 1.0) > 0.25

        def where() -> list[float]:
            return [driver.state().x, driver.state().y, driver.state().theta]

        assert until(driven)
        assert until(lambda: driver.send(0.0, 0.0) or rig.emulator.stopped)
        assert until(lambda: math.dist(where(), rig.emulator.pose) < 1e-3)
        assert abs(driver.inner.state().theta - (rig.emulator.pose[2] - 0.5)) > 0.05
        # a stranger at the port, and silence
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"1 9 9 9", ("127.0.0.1", port))
            assert until(lambda: driver.health().counters["source_others"] == 1)
        camera.close()
        status = driver.health()
        assert {f"source_{name}" for name in COUNTERS} <= set(status.counters) and status.counters[
            "source_poses"
        ] > 50
        # the board is heard, its poses are not
        assert until(lambda: driver.health().heartbeat_stamp - driver.health().pose_stamp > 0.25)
        assert driver.health().pose_stamp == driver.state().stamp
    finally:
        camera.close()
        driver.close()
        rig.emulator.close()


def test_an_autopilot_is_fed_with_the_pose_and_judged_by_the_source(tmp_path):
    pytest.importorskip("pymavlink")
    from firmware_bridge.emulator.rover.parameters import MOTION_CAPTURE
    from firmware_bridge.emulator.rover.rover import RoverEmulator

    port, url = free_port(), f"pty:{tmp_path}/rover"
    rover = RoverEmulator(
        arm_after=0.1, uptime=5.0, parameters=MOTION_CAPTURE, pose=(1.0, 2.0, 0.5)
    )
    rover.start(url)
    camera = MocapSender(lambda: rover.pose, f"udp:127.0.0.1:{port}")
    board = {"origin": [47.0, 8.0, 400.0], "arm": True}
    robot = load_robot(
        None,
        {
            "link": {"url": url, "driver": "mavlink", "pose": f"udp:127.0.0.1:{port}"},
            "board": board,
        },
    )
    driver = open_driver(robot, open_transport(url))
    try:
        camera.start()
        driver.connect(20.0)
        assert until(lambda: driver.health().ready, 10.0)
        state = driver.state()
        assert (state.x, state.y, state.theta) == pytest.approx((1.0, 2.0, 0.5), abs=0.02)
        camera.close()
        # the autopilot's own estimate looks valid for seconds; the source tells
        assert until(lambda: driver.state().stamp - driver.health().pose_stamp > 0.3)
    finally:
        camera.close()
        driver.close()
        rover.close()


def test_a_port_in_use_and_other_urls_are_refused_in_one_line(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        driver = posed(other.getsockname()[1], url=f"pty:{tmp_path}/none")
        with pytest.raises(LinkError, match="another program has the port"):
            driver.connect(0.1)
        driver.close()
    for url in (
        "tcp:127.0.0.1:5005",
        "serial:/dev/ttyUSB0",
        "udp:5005",
        "udp:127.0.0.1:99999",
        "udp:127.0.0.1:5005?listen=1",
    ):
        with pytest.raises(ConfigError, match=r"expected|unknown option"):
            load_robot(None, {"link": {"url": "pty:x", "driver": "vesc", "pose": url}})
    robot = load_robot(
        None,
        {
            "link": {"url": "pty:x", "driver": "mavlink", "pose": "udp:127.0.0.1:5005"},
            "board": {"pose": "ekf"},
        },
    )
    with pytest.raises(ConfigError, match=r"board.pose: 'ekf' contradicts link.pose"):
        robot.driver_table()


def test_nothing_but_this_computer_is_listened_to_unless_told():
    driver = PosedDriver(_Nobody(), "udp::0")
    driver.connect(0.1)
    assert driver._endpoint._opened._socket.getsockname()[0] == "127.0.0.1"
    driver.close()


class _Nobody:
    def connect(self, timeout):
        pass

    def send(self, v, omega):
        pass

    stop = close = state = health = lambda self: None


def test_a_whole_run_by_motion_capture(tmp_path, monkeypatch, capsys):
    import threading

    from firmware_bridge.cli.emulate import build_emulator
    from firmware_bridge.cli.main import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    (tmp_path / "course.toml").write_text(COURSE)
    robot_file = (
        "[geometry]\nwheel_radius = 0.0425\ntrack = 0.27\nmax_wheel_speed = "
        "0.9\n[board]\ncounts_per_turn = 1440.0\n"
    )
    pose = f"udp:127.0.0.1:{free_port()}"
    (tmp_path / "robot.toml").write_text(
        f'[link]\nurl = "pty:link"\ndriver = "roboclaw"\npose = "{pose}"\n{robot_file}'
    )
    # the wheels slip, so that their odometry would not arrive
    emulator = build_emulator(load_robot("robot.toml"), (0.0, 0.0, 0.0), 0.2, 0.7, 1, 0.1)
    camera = MocapSender(lambda: emulator.pose, pose)
    emulator.start("pty:link")
    camera.start()
    try:
        quick = [
            "--v-max",
            "0.5",
            "--omega-max",
            "1.5",
            "--settle",
            "0.3",
            "--seconds",
            "25",
            "--set",
            "safety.hold=0.3",
            *PATIENT,
        ]
        status = main(["run", "robot.toml", "--scenario", "course.toml", "--json", *quick])
        report = json.loads(capsys.readouterr().out)
        assert status == 0, report
        x, y, _ = emulator.pose
    finally:
        camera.close()
        emulator.close()
    assert math.hypot(x - 0.7, y - 0.15) < 0.08 and report["counters"]["source_poses"] > 50
    assert threading.active_count() < 10
