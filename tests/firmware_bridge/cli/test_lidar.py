"""Commands and lidars: what kmpc check tells, what kmpc emulate refuses, where options go."""

import argparse
import json

import numpy as np
import pytest

from firmware_bridge.cli.lidar_check import fit, hints, seen
from firmware_bridge.cli.options import add_robot_options, read_robot
from firmware_bridge.robot_file import load_robot
from firmware_bridge.sensors.sight import Scan
from kmpc_lab.emulator.lidar import emulated_lidar
from kmpc_lab.emulator.vesc import VescEmulator
from kmpc_lite.cli.main import main
from kmpc_lite.scenario.world import World

ROBOT = """
[link]
url = "pty:{folder}/vesc"
driver = "vesc"
[geometry]
wheel_radius = 0.0425
track = 0.27
max_wheel_speed = 0.9
[board]
can_id = 1
pole_pairs = 7
[safety]
socket = "{folder}/estop"
scan_age = 1.0
pose_age = 1.0
heartbeat_age = 1.0
"""
LIDAR = """
[lidar]
driver = "ld06"
link = "pty:{folder}/lidar"
timeout = 1.5
"""
WALLS = np.array([[-2, -2, 2, -2], [2, -2, 2, 2], [2, 2, -2, 2], [-2, 2, -2, -2]], float)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text((ROBOT + LIDAR).format(folder=tmp_path))
    robot = load_robot(path)
    board = VescEmulator.from_options(robot.driver_table())
    world = World([(0.0, 1.0, 0.3, 0.0, 0.0), (-0.25, 0.0, 0.05, 0.0, 0.0)], WALLS)
    lamp = emulated_lidar(robot.lidar, world, lambda: board.pose)
    board.start(robot.link.url)
    lamp.start(robot.lidar.link)
    yield path, lamp
    lamp.close()
    board.close()


def check(path, capsys, *more):
    status = main(["check", str(path), "--seconds", "0.6", "--json", *more])
    return status, [(f["ok"], f["text"]) for f in json.loads(capsys.readouterr().out)["findings"]]


def test_check_reports_what_is_seen_and_what_looks_wrong(file, capsys):
    path, lamp = file
    status, found = check(path, capsys)
    lines = [text for _, text in found]
    assert status == 0, found
    assert any(line.startswith("lidar: LD06/LD19: ") and "turns/s" in line for line in lines)
    (nearest,) = [line for line in lines if "nearest" in line and "hint" not in line]
    assert "nearest 0.2" in nearest or "nearest 0.1" in nearest  # the pole behind, with noise
    assert any("lidar.ignore = [[2.9" in line or "lidar.ignore = [[3." in line for line in lines)
    assert any("hold a hand" in line for line in lines)
    lamp.faults.covered = True
    status, found = check(path, capsys)
    assert status == 1
    assert any(not ok and "covered" in text or "no turn" in text for ok, text in found)


def test_check_reports_a_lidar_that_is_none(file, capsys):
    path, lamp = file
    status, found = check(path, capsys, "--lidar", "rplidar")
    assert status == 1 and any("no packet" in t or "no byte" in t for ok, t in found if not ok)
    lamp.faults.mute = True
    status, found = check(path, capsys)
    assert status == 1 and any("no byte" in text for ok, text in found if not ok)
    # the board is looked at all the same
    assert any(ok and text.startswith("pose: ") for ok, text in found)
    assert not any("would let it drive" in text for _, text in found)


def scan_of(ranges, mount=(0.0, 0.0, 0.0)):
    return Scan(np.array(ranges), -np.pi, 2 * np.pi / len(ranges), 0.05, 8.0, mount, 1.0)


def test_hints_follow_from_what_is_seen(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text((ROBOT + LIDAR).format(folder=tmp_path))
    robot = load_robot(path)
    ranges = np.full(360, 2.0)
    ranges[350:] = ranges[:10] = 0.2  # behind
    told = hints(scan_of(ranges), robot)
    assert "lidar.ignore = [[2.96, -2.98]]" in told[1] and len(told) == 2
    ranges[:] = np.nan
    assert 'no_return = "free"' in hints(scan_of(ranges), robot)[1]
    assert seen(scan_of(ranges)) == "lidar: nothing within 8 m; 100 % of 360 beams are unknown"
    ranges[270] = 0.5
    assert "nearest 0.50 m from it, 90 degrees left of ahead" in seen(scan_of(ranges))
    assert "straight ahead" in seen(scan_of(ranges, (0.0, 0.0, -np.pi / 2)))


@pytest.mark.parametrize(("mirrored", "turn"), [(False, 0.0), (True, 0.0), (False, 1.5708)])
def test_a_wrong_mount_is_found_by_the_map(mirrored, turn):
    world, place = World([(1.0, 1.0, 0.3, 0.0, 0.0)], WALLS), (0.5, -0.4, 0.7)
    angles = -np.pi + 2 * np.pi / 360 * np.arange(360)
    own = (-angles if mirrored else angles) + turn
    ranges = world.ranges(np.array(place[:2]), place[2] + own)
    told = fit(scan_of(ranges), place, world, False)
    if not mirrored and not turn:
        assert told == ["lidar: 100 % of its hits lie where the map has something"]
        return
    assert f"lidar.mirrored = {str(mirrored).lower()} and {turn:.2f} as" in told[1]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--lidar"], "nothing to see: give --scenario NAME"),
        (["--lidar", "ld06"], "lidar.link: missing: give --lidar-link URL"),
        (["--lidar", "sonar"], "invalid choice: 'sonar'"),
    ],
)
def test_emulate_says_what_a_lidar_needs(tmp_path, capsys, more, words):
    path = tmp_path / "robot.toml"
    text = ROBOT if more[1:] else ROBOT + LIDAR
    path.write_text(text.format(folder=tmp_path))
    assert main(["emulate", str(path), *more]) == 2
    assert words in capsys.readouterr().err


def test_options_reach_the_robot():
    parser = argparse.ArgumentParser()
    add_robot_options(parser)
    parser.add_argument("--by-sight", dest="control.map", action="store_const", const=False)
    words = ["--driver", "mavlink", "--link", "tcp:127.0.0.1:1", "--lidar", "ld06"]
    words += ["--lidar-link", "pty:x", "--set", "lidar.mount=[0.1, 0, 0]"]
    robot = read_robot(parser.parse_args([*words, "--by-sight"]))
    assert robot.lidar.driver == "ld06" and robot.control.map is False
    robot = read_robot(parser.parse_args(words))
    assert (robot.lidar.link, robot.lidar.mount) == ("pty:x", (0.1, 0.0, 0.0))
    assert robot.control.map is True


def test_by_sight_needs_eyes(capsys):
    words = ["run", "--driver", "mavlink", "--link", "tcp:127.0.0.1:1"]
    assert main([*words, "--scenario", "four_circles_1", "--by-sight"]) == 2
    assert "control.map: false needs a [lidar]" in capsys.readouterr().err
