"""The emulated ODrive against lines of the documentation."""

import pytest

from firmware_bridge.kinematics import WheelGeometry
from kmpc_lab.emulator.odrive import ODriveEmulator

ROBOT = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=2.0)


@pytest.fixture
def board(clock):
    return ODriveEmulator(ROBOT, clock=clock)


def test_speaks_the_lines_of_the_documentation(board, clock):
    assert board.handle(b"r axis0.current_state\n") == b"1\r\n"
    assert board.handle(b"w axis0.requested_state 8\nw axis1.requested_state 8 ; comment\n") == b""
    assert board.handle(b"v 0 1.5 0\nv 1 -0.5\n") == b""
    clock.now += 1.0
    position, speed = map(float, board.handle(b"f 0\n").split())
    assert speed == pytest.approx(1.5, abs=1e-3) and 1.3 < position < 1.5
    position, speed = map(float, board.handle(b"f 1!").split())
    assert speed == pytest.approx(-0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        (b"x\n", b"unknown command\r\n"),
        (b"v 0\n", b"invalid command format\r\n"),
        (b"v 7 1\n", b"invalid motor 7\r\n"),
        (b"w axis0.config.watchdog_timeout soon\n", b"not implemented\r\n"),
        (b"\xff\xfe\x00\n", b""),
    ],
)
def test_odd_lines(board, line, reply):
    assert board.handle(line) == reply
