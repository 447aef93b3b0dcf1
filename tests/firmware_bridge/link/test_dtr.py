"""The line DTR of a serial port: set while the port is open, the opposite when it is closed."""

import fcntl
import os
import termios

import pytest
from serial.serialposix import TIOCM_DTR_str as DTR

from firmware_bridge.link.serial_port import SerialPort


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
    port = SerialPort(os.ttyname(slave), 9600, False, on)
    assert {held for held, line in done if line == DTR} == {on}
    done.clear()
    port.close()
    assert done == [(not on, DTR)]
    done.clear()
    SerialPort(os.ttyname(slave), 9600, False).close()
    assert (False, DTR) not in done
    os.close(master)
    os.close(slave)


def test_a_port_that_has_no_such_line_is_reported_and_not_left_open():
    master, slave = os.openpty()
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError):
        SerialPort(os.ttyname(slave), 9600, False, False)
    assert len(os.listdir("/proc/self/fd")) == before
    os.close(master)
    os.close(slave)
