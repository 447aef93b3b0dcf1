"""The table of boards: each has a driver and an emulator, and everything that lists boards."""

import inspect

import pytest

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
