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
        (b"r nonsense\n", b"invalid property\r\n"),
        (b"r axis0.active_errors\n", b"invalid property\r\n"),
        (b"r\n", b"invalid command format\r\n"),
        (b"v 0\n", b"invalid command format\r\n"),
        (b"v 7 1\n", b"invalid motor 7\r\n"),
        (b"f x\n", b"invalid command format\r\n"),
        (b"w axis0.config.watchdog_timeout soon\n", b"not implemented\r\n"),
        (b"\n\r\n", b""),
        (b"r axis0.error*0\n", b""),
        (b"\xff\xfe\x00\n", b""),
    ],
)
def test_odd_lines(board, line, reply):
    assert board.handle(line) == reply


def test_checksums_are_answered_with_checksums(board):
    line = b"r axis0.error"
    total = 0
    for byte in line:
        total ^= byte
    assert board.handle(line + b"*%d\n" % total) == b"0*48\r\n"


def test_watchdog_disarms_with_an_error_and_only_v_and_u_feed_it(board, clock):
    board.handle(
        b"w axis0.config.watchdog_timeout 0.5\nw axis0.config.enable_watchdog 1\n"
        b"w axis0.requested_state 8\nv 0 1 0\n"
    )
    for feed in (b"v 0 1 0\n", b"u 0\n") * 3:
        clock.now += 0.45
        assert not board.stopped
        board.handle(feed)
    clock.now += 0.45
    board.handle(b"f 0\nr axis0.error\n")
    clock.now += 0.1
    assert (
        board.stopped
        and board.handle(b"r axis0.error\n") == b"2048\r\n"
        and board.handle(b"r axis0.current_state\n") == b"1\r\n"
    )
    board.handle(b"v 0 1 0\nw axis0.requested_state 8\n")
    assert board.stopped, "errors stand until they are cleared"
    board.handle(b"u 0\nsc\nw axis0.requested_state 8\nv 0 1 0\n")
    assert not board.stopped


def test_reboot_by_line_forgets_what_was_not_saved(board, clock):
    board.handle(b"w axis0.requested_state 8\nw axis0.config.enable_watchdog 1\nu 0\nv 0 1\n")
    clock.now += 0.01
    board.handle(b"sr\n")
    assert (
        board.stopped
        and board.handle(b"r axis0.config.enable_watchdog\nr axis0.current_state\n")
        == b"0\r\n1\r\n"
    )
