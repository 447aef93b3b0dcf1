"""What a user reads when a port cannot be had, and which program has it."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import termios

import pytest
from free_port import free_port
from serial.serialposix import TIOCM_DTR_str as DTR
from waiting import until

from firmware_bridge.link import open_transport
from firmware_bridge.link.serial_port import SerialPort, explain
from firmware_bridge.link.server import serve
from firmware_bridge.messages import ConfigError, LinkError


def test_nothing_there(tmp_path):
    with pytest.raises(
        LinkError, match="nothing listens there: is the vehicle or emulator running"
    ):
        open_transport(f"tcp:127.0.0.1:{free_port()}").start(lambda data, stamp: None)
    with pytest.raises(LinkError, match="no such port: is the cable in"):
        open_transport(f"pty:{tmp_path}/none").start(lambda data, stamp: None)
    with pytest.raises(LinkError, match="not a serial port"):
        (tmp_path / "file").write_text("x")
        open_transport(f"serial:{tmp_path}/file").start(lambda data, stamp: None)
    with pytest.raises(LinkError, match="not a serial port"):
        open_transport(f"serial:{tmp_path}").start(lambda data, stamp: None)


def test_no_permission_names_the_group(monkeypatch, tmp_path):
    def refuse(path, *args, **kwargs):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(
        LinkError, match=r"no permission: run 'sudo usermod -aG \S+ \$USER' and log in again"
    ):
        open_transport(f"serial:{tmp_path}/ttyACM0").start(lambda data, stamp: None)
    assert "dialout" in explain("/dev/none", PermissionError(errno.EACCES, "Permission denied"))


def test_second_tcp_client_is_turned_away(opened):
    url = f"tcp:127.0.0.1:{free_port()}"
    board, first = opened(serve(url)), opened(open_transport(url))
    assert until(lambda: board.transport.connected)
    second = opened(open_transport(url))
    assert until(lambda: not second.transport.connected)
    assert first.transport.write(b"mine") and until(lambda: board.data == b"mine")
    assert board.transport.endpoint.turned_away >= 1


def test_listener_in_use(opened, tmp_path):
    for url in (
        f"tcp:127.0.0.1:{free_port()}",
        f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}",
        f"pty:{tmp_path}/port",
    ):
        opened(serve(url))
        with pytest.raises(LinkError, match="in use|is there"):
            serve(url).start(lambda data, stamp: None)


def test_pty_takes_over_the_link_of_a_dead_emulator(tmp_path, opened):
    os.symlink("/dev/pts/99999999", tmp_path / "port")
    opened(serve(f"pty:{tmp_path}/port"))
    assert (tmp_path / "port").exists()


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("udp:localhost:70000", "port from 0 to 65535"),
        ("serial:", "expected serial:PATH"),
        ("serial:/dev/ttyACM0?baud=fast", "baud: expected a number"),
        ("serial:/dev/ttyACM0?baud=1", "baud: expected a number from 300"),
        ("serial:/dev/ttyACM0?speed=9600", "unknown option 'speed'"),
        ("serial:/dev/ttyACM0?baud", "name=value"),
        ("tcp:localhost:1?x=1", "unknown option 'x'; tcp: takes none"),
    ],
)
def test_bad_urls(url, message):
    with pytest.raises(ConfigError) as caught:
        open_transport(url)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_serving_a_serial_port_is_refused():
    with pytest.raises(ConfigError, match="an emulator serves pty:"):
        serve("serial:/dev/ttyACM0")


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
