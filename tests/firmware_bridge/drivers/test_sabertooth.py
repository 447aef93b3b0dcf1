"""Sabertooth and SyRen: bytes of the manuals, time-out, zeros that are repeated."""

import math
import time

import pytest
from boards import GEOMETRY, Spy
from waiting import until

from firmware_bridge.drivers.sabertooth import SabertoothDriver, SabertoothOptions, packet
from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError
from kmpc_lab.emulator.sabertooth import SabertoothEmulator

ROBOT = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=1.0)
OPTIONS = SabertoothOptions(full_speed=1.27)
TABLE = {"geometry": GEOMETRY, "board": {"full_speed": 1.2, "watchdog": 0.3}}


@pytest.fixture
def board(clock):
    return SabertoothEmulator(ROBOT, OPTIONS, clock=clock)


def rims(board):
    return [speed * 0.05 for speed in board.wheel_command]


def test_speaks_the_bytes_of_the_manual(board):
    assert packet(130, 0, 64) == bytes((130, 0, 64, 66)), "the example of the manual"
    half = bytes((128, 0, 64, 64))
    assert board.handle(half) == b""
    assert board.stopped, "deaf before the bauding character"
    assert board.handle(b"\xaa" + half + bytes((128, 5, 127, 4))) == b""
    assert rims(board) == pytest.approx([0.64, -1.27])


def test_damaged_and_foreign_packets_do_nothing(board):
    board.handle(b"\xaa")
    for bad in (bytes((128, 0, 64, 65)), packet(129, 0, 64), bytes((128, 0, 200, 72)), b"\x40" * 9):
        board.handle(bad)
        assert board.stopped
    board.handle(b"\x80\x00" + packet(128, 0, 64))
    assert not board.stopped, "half a packet costs itself only"


def test_serial_timeout_stops(board, clock):
    board.handle(b"\xaa" + packet(128, 14, 3) + packet(128, 0, 100))
    clock.now += 0.29
    assert not board.stopped
    clock.now += 0.02
    assert board.stopped


def test_two_syrens_drive_a_motor_each(clock):
    options = SabertoothOptions(full_speed=1.27, second_address=129)
    board = SabertoothEmulator(ROBOT, options, clock=clock)
    board.handle(b"\xaa" + packet(128, 0, 100) + packet(129, 1, 50))
    assert rims(board) == pytest.approx([1.0, -0.5])


@pytest.fixture(params=[None, 129])
def rig(request, tmp_path):
    board = {
        **TABLE["board"],
        **({} if request.param is None else {"second_address": request.param}),
    }
    table = {**TABLE, "board": board}
    emulator = SabertoothEmulator.from_options(table)
    emulator.start(f"pty:{tmp_path}/port")
    wire = Spy(open_transport(f"pty:{tmp_path}/port"))
    driver = SabertoothDriver.from_options(wire, table)
    driver.connect(3.0)
    yield driver, emulator, wire
    driver.close()
    emulator.close()


def test_drives_scaled_to_full_speed_and_stops(rig):
    driver, emulator, wire = rig
    assert driver.health().ready
    driver.send(0.4, 0.5)
    left, right = (speed * 0.0425 for speed in emulator.wheel_command)
    assert until(lambda: not emulator.stopped)
    left, right = (speed * 0.0425 for speed in emulator.wheel_command)
    assert (left + right) / 2 == pytest.approx(0.4, abs=0.02)
    assert (right - left) / 0.27 == pytest.approx(0.5, abs=0.06)
    driver.stop()
    assert until(lambda: emulator.stopped)
    driver.send(0.3, 0.0)
    time.sleep(0.1)
    assert emulator.stopped
    assert driver.health().counters["refused_commands"] == 1
    driver.send(0.0, 0.0)
    driver.send(0.3, 0.0)
    assert until(lambda: not emulator.stopped)


def test_an_old_command_is_replaced_by_zero(rig):
    driver, emulator, _ = rig
    driver.send(0.4, 0.0)
    assert until(lambda: not emulator.stopped)
    assert until(lambda: emulator.stopped and driver.health().counters["stale_commands"] == 1)


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.0, math.inf)])
def test_non_finite_commands_never_reach_the_wire(rig, command):
    driver, _, wire = rig
    before = len(wire.frames)
    with pytest.raises(ValueError, match="finite"):
        driver.send(*command)
    assert all(frame.startswith((b"\xaa", packet(128, 0, 0))) for frame in wire.frames[before:])


def test_close_says_zero_last(rig):
    driver, emulator, wire = rig
    driver.send(0.4, 0.0)
    driver.close()
    driver.close()
    assert wire.frames[-1].startswith(packet(128, 0, 0))


def test_a_wheel_faster_than_full_speed_is_refused():
    with pytest.raises(ConfigError, match="board.full_speed: expected at least"):
        SabertoothDriver(open_transport("pty:x"), ROBOT, SabertoothOptions(full_speed=0.5))
