"""Roboteq: the emulator against the words of the manual, and what only this driver does."""

import pytest
from boards import Rig
from waiting import until

from firmware_bridge.drivers.roboteq import RoboteqOptions
from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.messages import LinkError
from kmpc_lab.emulator.roboteq import RoboteqEmulator

OPTIONS = RoboteqOptions(counts_per_turn=4000)
ROBOT = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=2.0)


@pytest.fixture
def board(clock):
    board = RoboteqEmulator(ROBOT, OPTIONS, clock=clock)
    assert board.handle(b"^ECHOF 1\r") == b"^ECHOF 1\r+\r"
    return board


def test_speaks_the_words_of_the_manual(board, clock):
    assert board.handle(b"^RWD 500\r~RWD\r") == b"+\rRWD=500\r"
    assert board.handle(b"~MMOD\r") == b"MMOD=1:1\r"
    assert board.handle(b"!S 1 120\r!S 2 -60\r") == b"+\r+\r"
    clock.now += 0.4
    assert board.handle(b"?S\r") == b"S=120:-60\r"
    first, second = map(int, board.handle(b"?C\r")[2:-1].split(b":"))
    assert first == pytest.approx(2 * 4000 * 0.35, rel=0.05)
    assert second == pytest.approx(-first / 2, abs=2)
    assert board.handle(b"?FF\r?FM\r") == b"FF=0\rFM=0:0\r"
    for nonsense in (b"?NONE\r", b"!S 3 10\r", b"!S 1 x\r", b"hello\r", b"^RWD -1\r"):
        assert board.handle(nonsense) == b"-\r"


def test_the_first_command_after_the_watchdog_lets_both_motors_go_on(board, clock):
    board.handle(b"!S 1 120\r!S 2 120\r")
    clock.now += 0.9
    assert not board.stopped
    for _ in range(3):
        board.handle(b"?S\r")
        clock.now += 0.1
    assert board.stopped, "questions do not feed the watchdog"
    board.handle(b"!S 2 0\r")
    assert board.wheel_command[0] == pytest.approx(4 * 3.14159, rel=1e-3)


def test_faults_stop_and_are_reported(tmp_path):
    rig = Rig("roboteq", f"pty:{tmp_path}/port").connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.emulator.handle(b"!EX\r")
    assert until(lambda: "emergency stop" in rig.driver.health().faults)
    assert not rig.driver.health().ready
    assert rig.emulator.stopped
    rig.emulator.handle(b"!MG\r")
    assert until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)
    rig.emulator.motor_flags[1] = 0x04
    assert until(lambda: "motor 2: loop error" in rig.driver.health().faults)
    assert not rig.driver.health().pose_ok
    rig.emulator.motor_flags[1] = 0x01
    assert until(lambda: "motor 2: amps limit" in rig.driver.health().mode)
    assert rig.driver.health().faults == ()
    rig.close()


def test_an_open_loop_board_is_refused_in_words(tmp_path):
    rig = Rig("roboteq", f"pty:{tmp_path}/port")
    rig.emulator.modes[:] = [1, 0]
    with pytest.raises(LinkError, match="mode 1 and 0, expected closed-loop speed: .MMOD 1 1"):
        rig.driver.connect(0.5)
    rig.close()
