"""Robots that drive by poses from outside."""

import json
import math
import socket

import pytest
from boards import TABLES
from boards import Rig as BoardRig
from courses import PATIENT
from free_port import free_port
from waiting import until

from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.sensors.pose import COUNTERS, PosedDriver
from kmpc_lab.emulator.mocap import MocapOptions, MocapSender


def posed(port, name="roboclaw", **more):
    """A driver of a board's robot file, with poses at a port."""
    table = {
        **TABLES[name],
        "link": {"url": more.pop("url"), "driver": name, "pose": f"udp:127.0.0.1:{port}"},
    }
    robot = load_robot(None, table)
    return open_driver(robot, open_transport(robot.link.url))


def test_a_board_drives_by_the_pose_of_the_source_and_not_by_its_wheels(tmp_path):
    port, url = free_port(socket.SOCK_DGRAM), f"pty:{tmp_path}/link"
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
    from kmpc_lab.emulator.rover.estimator import MOTION_CAPTURE
    from kmpc_lab.emulator.rover.rover import RoverEmulator

    port, url = free_port(socket.SOCK_DGRAM), f"pty:{tmp_path}/rover"
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


def test_a_whole_run_by_motion_capture(desk, capsys):
    import threading

    from kmpc_lab.emulator.build import build_emulator
    from kmpc_lite.cli.main import main

    robot_file = (
        "[geometry]\nwheel_radius = 0.0425\ntrack = 0.27\nmax_wheel_speed = "
        "0.9\n[board]\nfull_speed = 0.9\n"
    )
    pose = f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    (desk / "robot.toml").write_text(
        f'[link]\nurl = "pty:link"\ndriver = "sabertooth"\npose = "{pose}"\n{robot_file}'
    )
    # the board tells nothing, and the wheels slip
    emulator = build_emulator(load_robot("robot.toml"), (0.0, 0.0, 0.0), 0.2, 0.7, 1, 0.1)
    camera = MocapSender(lambda: emulator.pose, pose)
    emulator.start("pty:link")
    camera.start()
    try:
        quick = "--v-max 0.5 --omega-max 1.5 --settle 0.3 --seconds 25 --set safety.hold=0.3"
        words = f"run robot.toml --scenario course.toml --json {quick}".split()
        status = main([*words, *PATIENT])
        report = json.loads(capsys.readouterr().out)
        assert status == 0, report
        x, y, _ = emulator.pose
    finally:
        camera.close()
        emulator.close()
    assert math.hypot(x - 0.7, y - 0.15) < 0.08 and report["counters"]["source_poses"] > 50
    assert threading.active_count() < 10
