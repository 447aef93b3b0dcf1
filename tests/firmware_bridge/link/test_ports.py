"""What a user reads when a port cannot be had, and who has it."""

import errno
import os
import socket

import pytest
from free_port import free_port
from waiting import until

from firmware_bridge.link import open_transport
from firmware_bridge.link.server import serve
from firmware_bridge.link.tty import explain
from firmware_bridge.messages import ConfigError, LinkError


def test_nobody_there(tmp_path):
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


def test_port_in_use(tmp_path, opened):
    opened(serve(f"pty:{tmp_path}/port"))
    opened(open_transport(f"pty:{tmp_path}/port"))
    for kind in ("pty", "serial"):
        with pytest.raises(LinkError, match="in use by another program"):
            open_transport(f"{kind}:{tmp_path}/port").start(lambda data, stamp: None)


def test_second_tcp_client_is_turned_away(opened):
    url = f"tcp:127.0.0.1:{free_port()}"
    board, first = opened(serve(url)), opened(open_transport(url))
    assert until(lambda: board.transport.connected)
    second = opened(open_transport(url))
    assert until(lambda: not second.transport.connected)
    assert first.transport.write(b"mine") and until(lambda: board.data == b"mine")
    assert board.transport.endpoint.turned_away >= 1


def test_second_udp_sender_is_refused(opened):
    port = free_port(socket.SOCK_DGRAM)
    board, first = (
        opened(serve(f"udp:127.0.0.1:{port}"), reply=b"re:"),
        opened(open_transport(f"udp:127.0.0.1:{port}")),
    )
    first.transport.write(b"one")
    assert until(lambda: first.data == b"re:one")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"evil", ("127.0.0.1", port))
        first.transport.write(b"two")
        assert until(lambda: first.data == b"re:onere:two")
    assert board.data == b"onetwo"


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


def test_pty_leaves_a_file_of_the_user_alone(tmp_path):
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(LinkError, match="another emulator or file is there"):
        serve(f"pty:{tmp_path}/notes").start(lambda data, stamp: None)
    assert (tmp_path / "notes").read_text() == "mine"


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("can:vcan0", "expected serial:, pty:, tcp:, udp:"),
        ("", "expected serial:"),
        ("tcp:localhost", "expected tcp:HOST:PORT"),
        ("tcp:localhost:http", "port from 0 to 65535"),
        ("udp:localhost:70000", "port from 0 to 65535"),
        ("serial:", "expected serial:PATH"),
        ("serial:/dev/ttyACM0?baud=fast", "baud: expected a number"),
        ("serial:/dev/ttyACM0?baud=115201", "baud: expected one of 9600"),
        ("serial:/dev/ttyACM0?speed=9600", "unknown option 'speed'"),
        ("serial:/dev/ttyACM0?baud", "name=value"),
        ("tcp:localhost:1?x=1", "unknown option 'x'; tcp: takes none"),
        ("udp:localhost:1?listen=2", "listen: expected a number from 0 to 1"),
    ],
)
def test_bad_urls(url, message):
    with pytest.raises(ConfigError) as caught:
        open_transport(url)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_serving_a_serial_port_is_refused():
    with pytest.raises(ConfigError, match="an emulator serves pty:"):
        serve("serial:/dev/ttyACM0")


def test_default_host_is_loopback(opened):
    port = free_port()
    board = opened(serve(f"tcp::{port}"))
    assert board.transport.endpoint._socket.getsockname() == ("127.0.0.1", port)
    assert opened(open_transport(f"tcp::{port}")).transport.connected
