"""The line DTR of a serial port: set while the port is open, the opposite when it is closed."""

import fcntl
import os
import termios

import pytest

from firmware_bridge.link.tty import DTR, TtyPort


@pytest.mark.parametrize("on", [False, True])
def test_it_is_set_and_set_back(on, monkeypatch):
    master, slave = os.openpty()
    done, real = [], fcntl.ioctl

    def ioctl(fd, request, *more):
        if request in (termios.TIOCMBIS, termios.TIOCMBIC):  # a pseudo-terminal has no such line
            done.append((request == termios.TIOCMBIS, *more))
            return 0
        return real(fd, request, *more)

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    port = TtyPort(os.ttyname(slave), None, False, on)
    assert done == [(on, DTR)]
    port.close()
    assert done == [(on, DTR), (not on, DTR)]
    TtyPort(os.ttyname(slave), None, False).close()
    assert len(done) == 2
    os.close(master)
    os.close(slave)


def test_a_port_that_has_no_such_line_is_reported_and_not_left_open():
    master, slave = os.openpty()
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError):
        TtyPort(os.ttyname(slave), None, False, False)
    assert len(os.listdir("/proc/self/fd")) == before
    os.close(master)
    os.close(slave)
