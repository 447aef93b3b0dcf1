"""RoboClaw: the emulator against raw bytes of the manual, and what only this driver does."""

import struct

import fastcrc
import pytest
from boards import GEOMETRY, Rig, distance, with_board
from waiting import until

from firmware_bridge.drivers.roboclaw import RoboClawDriver, RoboClawOptions
from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError
from kmpc_lab.emulator.roboclaw import RoboClawEmulator

OPTIONS = RoboClawOptions(counts_per_turn=1440)
ROBOT = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=2.0)


def framed(*body):
    data = bytes(body)
    return data + struct.pack(">H", fastcrc.crc16.xmodem(data))


def asked(emulator, command, form):
    """Read a register with nothing of the bridge but the emulator."""
    reply = emulator.handle(bytes((0x80, command)))
    assert fastcrc.crc16.xmodem(bytes((0x80, command)) + reply) == 0 or struct.unpack(
        ">H", reply[-2:]
    )[0] == fastcrc.crc16.xmodem(bytes((0x80, command)) + reply[:-2])
    return struct.unpack(form, reply[:-2])


@pytest.fixture
def board(clock):
    return RoboClawEmulator(ROBOT, OPTIONS, clock=clock)


def test_speaks_the_bytes_of_the_manual(board, clock):
    assert board.handle(bytes.fromhex("80 0e 03 28 36")) == b"\xff" and board.timeout == 3
    assert board.handle(bytes.fromhex("80 25 00 00 03 e8 ff ff fc 18 82 90")) == b"\xff"
    clock.now += 0.2
    assert asked(board, 15, ">B") == (3,)
    clock.now += 0.2
    first, second = asked(board, 79, ">ii")
    assert 900 < first <= 1000 and second == -first
    counts = asked(board, 78, ">ii")
    assert 200 < counts[0] < 400 and counts[1] == -counts[0]
    speed, backwards = asked(board, 19, ">IB")
    assert speed == first and backwards == 1
    assert asked(board, 90, ">I") == (0,)


def test_serial_timeout_stops_and_any_byte_feeds_it(board, clock):
    board.handle(framed(0x80, 14, 3))
    speed = framed(0x80, 37, *struct.pack(">ii", 1440, 1440))
    board.handle(speed)
    for _ in range(5):
        clock.now += 0.29
        assert not board.stopped
        board.handle(b"\x80\x0f")
    clock.now += 0.35
    assert board.stopped
    clock.now += 0.5
    x = board.pose[0]
    clock.now += 0.5
    assert board.pose[0] == x > 0.0
    board.handle(speed)
    assert not board.stopped


@pytest.fixture
def rig(tmp_path):
    rig = Rig("roboclaw", f"pty:{tmp_path}/port")
    yield rig
    rig.close()


def test_sets_the_watchdog_in_tenths_rounded_up_and_reads_it_back(tmp_path):
    rig = Rig("roboclaw", f"pty:{tmp_path}/port", with_board("roboclaw", watchdog=0.41)).connect()
    assert rig.emulator.timeout == 5
    rig.close()


def test_a_board_that_does_not_take_the_watchdog_is_refused(rig, monkeypatch):
    def forget(self, command, payload, write=RoboClawEmulator._write):
        write(self, command, payload)
        self.timeout = 0

    monkeypatch.setattr(RoboClawEmulator, "_write", forget)
    with pytest.raises(
        LinkError, match="cannot drive: the board did not take a serial time-out of 0.3 s"
    ):
        rig.driver.connect(0.4)


def test_a_watchdog_that_was_switched_off_is_set_again(rig):
    rig.connect()
    rig.emulator.timeout = 0
    assert until(lambda: rig.emulator.timeout == 3)
    assert rig.counters["board_restarts"] == 1
    assert not rig.driver.health().pose_ok and until(lambda: rig.driver.health().ready)


def test_old_firmware_with_two_status_bytes(tmp_path):
    rig = Rig("roboclaw", f"pty:{tmp_path}/port", status_bytes=2).connect()
    rig.emulator.status = 0x0004 | 0x0800
    assert until(lambda: rig.driver.health().faults == ("emergency stop",))
    assert rig.driver.health().mode == "main voltage low warning" and not rig.driver.health().ready
    rig.close()


def test_errors_stop_and_warnings_do_not(rig):
    rig.connect()
    rig.emulator.status = 0x00080000
    assert until(lambda: "main voltage low warning" in rig.driver.health().mode)
    assert rig.driver.health().ready and rig.driver.health().faults == ()
    rig.drive(0.3, 0.0, 0.1)
    assert not rig.emulator.stopped
    rig.emulator.status = 0x00000101
    assert until(lambda: not rig.driver.health().ready)
    assert (
        rig.driver.health().faults == ("emergency stop", "M1 speed error: encoder lost?")
        and not rig.driver.health().pose_ok
    )
    rig.emulator.status = 0
    assert until(lambda: rig.driver.health().ready and rig.driver.health().pose_ok)


def test_counters_wrap_round_on_the_way(rig):
    rig.emulator.offset_counts(2**31 - 50, -(2**31) + 50)
    rig.connect()
    rig.drive(0.4, 0.2, 0.4)
    rig.driver.send(0.0, 0.0)
    assert until(lambda: abs(rig.driver.state().v) < 1e-3)
    assert until(lambda: distance(rig.driver, rig.emulator)[0] < 0.005)
    assert rig.emulator.pose[0] > 0.1 and rig.counters["odometry_jumps"] == 0


def test_acceleration_uses_command_40(tmp_path):
    rig = Rig(
        "roboclaw", f"pty:{tmp_path}/port", with_board("roboclaw", acceleration=1.0)
    ).connect()
    rig.drive(0.3, 0.0, 0.1)
    moves = [frame for frame in rig.wire.frames if frame[1] in (37, 40)]
    assert {frame[1] for frame in moves} == {40} and len(moves[0]) == 16
    assert struct.unpack(">I", moves[0][2:6])[0] == round(
        1440 * 20 / (2 * 3.141592653589793 * 0.0425)
    )
    rig.close()


@pytest.mark.parametrize(
    ("board", "message"),
    [
        ({}, "board.counts_per_turn: missing"),
        ({"counts_per_turn": 1440, "address": 0x90}, "board.address: expected 128 to 135, got 144"),
        (
            {"counts_per_turn": 1440, "acceleration": "high"},
            "board.acceleration: expected float, got 'high'",
        ),
    ],
)
def test_bad_options_name_the_key(board, message):
    geometry = {**GEOMETRY, "gear_ratio": 1000.0}
    with pytest.raises(ConfigError) as caught:
        RoboClawDriver.from_options(
            open_transport("pty:unused"), {"geometry": geometry, "board": board}
        )
    assert str(caught.value).startswith(message)
