"""The table of boards: each has a driver and an emulator, and everything that lists boards."""

from __future__ import annotations

import inspect
import json
import os
import shutil
import subprocess
import sys

import pytest
from pages import ROOT, read

from firmware_bridge.cli.init import templates
from firmware_bridge.drivers import Driver
from firmware_bridge.drivers.boards import BOARDS, load
from firmware_bridge.link import open_transport
from firmware_bridge.robot_file import DRIVERS, NOMINAL_LATENCY, TOPICS, load_robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.sensors.sensor_driver import autopilot_of
from kmpc_lab.emulator.build import EMULATORS, Emulator, build_emulator


def methods(protocol):
    return {name for name, member in vars(protocol).items() if inspect.isfunction(member)} - {
        "__init__",
        "__subclasshook__",
    }


@pytest.mark.parametrize("name", BOARDS)
def test_a_board_has_a_driver_and_an_emulator_of_the_same_robot_file(name):
    board = BOARDS[name]
    assert board.name == name == board.label.lower()
    driver, emulator = load(board.driver), load(EMULATORS[name])
    assert methods(Driver) <= set(dir(driver)) and methods(Emulator) <= set(dir(emulator))
    pose = None if board.encoders else "udp:127.0.0.1:5"
    sections = {
        "link": {"url": "tcp:127.0.0.1:5", "driver": name, "pose": pose},
        "board": board.options,
        "geometry": board.geometry,
    }
    robot = load_robot(None, sections)
    made = open_driver(robot, open_transport(robot.link.url))
    assert (autopilot_of(made) is not None) == robot.is_autopilot
    made.close()
    built = build_emulator(robot, (1.0, 2.0, 0.5), 0.0, 1.0, 0, 0.1)
    assert isinstance(built, emulator) and built.pose == pytest.approx((1.0, 2.0, 0.5))
    built.close()


def test_all_that_lists_boards_follows_the_table():
    assert set(BOARDS) == set(DRIVERS) == set(NOMINAL_LATENCY) - {TOPICS}
    assert {{"rover": "mavlink"}.get(name, name) for name in templates()} == set(BOARDS)


BOARD = ROOT / "examples" / "own_board"


def test_a_board_of_ones_own_is_one_class_and_one_entry_point(tmp_path):
    assert len(read(BOARD / "wheelie.py").splitlines()) <= 80
    shutil.copytree(BOARD, tmp_path, dirs_exist_ok=True)
    entry = read(BOARD / "pyproject.toml")
    (installed := tmp_path / "wheelie-1.dist-info").mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: wheelie\nVersion: 1\n")
    name, _, where = entry.splitlines()[-1].partition(" = ")
    (installed / "entry_points.txt").write_text(f"[kmpc.boards]\n{name} = {where.strip(chr(34))}\n")
    here = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(tmp_path)}}

    def kmpc(*words):
        program = [sys.executable, "-m", "kmpc_lite.cli.main", *words, "--json"]
        done = subprocess.run(program, capture_output=True, text=True, timeout=100, **here)
        return done.returncode, json.loads(done.stdout)

    status, told = kmpc("check", "robot.toml", "--set", "link.timeout=0.3")
    assert status != 0 and "no such port" in json.dumps(told)
    with subprocess.Popen([sys.executable, "emulated_wheelie.py"], **here) as board:
        try:
            status, report = kmpc("run", "robot.toml", "--goal", "0.4", "0", "0", "--seconds", "60")
            assert status == 0 and report["arrived"], report
        finally:
            board.kill()
    (tmp_path / "wheelie.py").write_text("import nothing_of_the_kind\n")
    status, told = kmpc("check", "robot.toml")
    assert status == 2 and "cannot import wheelie:WheelieDriver" in told["error"]
