"""Transports over real descriptors: pseudo-terminals, TCP, UDP."""

import os
import select
import socket

import pytest
from free_port import free_port
from waiting import until

from firmware_bridge.link import open_transport, sockets
from firmware_bridge.link.server import serve
from firmware_bridge.link.threaded import QUEUE_FRAMES, ThreadedTransport
from firmware_bridge.messages import LinkError


def test_there_and_back(url, opened):
    board = opened(serve(url), reply=b"re:")
    bridge = opened(open_transport(url))
    assert until(lambda: board.transport.connected)
    assert bridge.transport.connected and bridge.transport.write(b"hello")
    assert until(lambda: bridge.data == b"re:hello") and board.data == b"hello"
    assert (
        bridge.transport.counters["bytes_out"] == 5 and bridge.transport.counters["bytes_in"] == 8
    )


def test_comes_back_after_a_loss_without_old_frames(url, opened):
    if url.startswith("udp"):
        pytest.skip("UDP knows no connection")
    board = opened(serve(url))
    bridge = opened(open_transport(url))
    bridge.transport.write(b"first")
    assert until(lambda: board.data == b"first")
    board.transport.close()
    assert until(lambda: not bridge.transport.connected)
    assert (
        not bridge.transport.write(b"into the void")
        and bridge.transport.counters["refused_writes"] == 1
    )
    again = opened(serve(url))
    assert until(lambda: bridge.transport.connected and again.transport.connected)
    assert bridge.transport.write(b"second") and until(lambda: again.data == b"second")
    assert bridge.transport.counters["reconnects"] == 1 and bridge.transport.last_error


def test_close_is_idempotent_and_final(url, opened):
    board, bridge = opened(serve(url)), opened(open_transport(url))
    bridge.transport.close()
    bridge.transport.close()
    assert not bridge.transport.connected and not bridge.transport.write(b"x")
    with pytest.raises(LinkError, match="started before"):
        bridge.transport.start(lambda data, stamp: None)
    board.transport.close()


def test_a_silent_udp_peer_is_not_replaced_by_another_host(monkeypatch):
    monkeypatch.setattr(sockets, "PEER_SILENCE", 0.0)
    endpoint = sockets.UdpEndpoint("127.0.0.1", port := free_port(socket.SOCK_DGRAM), listen=True)
    for _ in range(2):  # the second time the link is opened again
        opened = endpoint.open()
        for host, heard in (("127.0.0.1", b"robot"), ("127.0.0.2", b""), ("127.0.0.1", b"robot")):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.bind((host, 0))  # a robot that was started again has another port
                sender.sendto(b"robot" if heard else b"stranger", ("127.0.0.1", port))
                select.select([opened], [], [], 5.0)
                assert opened.read() == heard, host
        assert endpoint.refused == 1
        opened.close()


class StalledPort:
    """Takes `room` bytes, then nothing until it gets more room."""

    def __init__(self):
        self.read_end, self.write_end = os.pipe()
        self.room, self.taken, self.closed = 0, bytearray(), False

    def fileno(self):
        return self.read_end

    def read(self):
        return b""

    def write(self, data):
        count = min(self.room, len(data))
        self.room -= count
        self.taken += data[:count]
        return count

    def close(self):
        if not self.closed:
            self.closed = True
            os.close(self.read_end)
            os.close(self.write_end)


class StalledEndpoint:
    def __init__(self, port):
        self.port = port

    def open(self):
        return self.port

    def fileno(self):
        return None

    def turn_away(self):
        raise AssertionError("nobody comes")

    def close(self):
        pass


def test_full_queue_keeps_the_newest_and_never_half_a_frame():
    port = StalledPort()
    transport = ThreadedTransport(StalledEndpoint(port))
    transport.start(lambda data, stamp: None)
    port.room = 2
    transport.write(b"first")
    assert until(lambda: port.taken == b"fi")
    frames = [b"<%04d>" % i for i in range(3 * QUEUE_FRAMES)]
    assert all(transport.write(frame) for frame in frames)
    assert transport.counters["dropped_frames"] == 2 * QUEUE_FRAMES
    port.room = 10_000
    transport.write(b"<last>")
    expected = b"first" + b"".join(frames[2 * QUEUE_FRAMES + 1 :]) + b"<last>"
    assert until(lambda: len(port.taken) >= len(expected)) and port.taken == expected
    transport.close()
    assert port.closed


def test_a_callback_that_raises_takes_the_link_down_and_not_the_thread(tmp_path, opened):
    url = f"tcp:127.0.0.1:{free_port()}"
    board = opened(serve(url))
    bridge = open_transport(url)
    heard = []

    def callback(data, stamp):
        heard.append(data)
        if len(heard) == 1:
            raise RuntimeError("bug in a parser")

    bridge.start(callback)
    assert until(lambda: board.transport.connected)
    board.transport.write(b"boom")
    assert until(lambda: bridge.counters["errors"] == 1 and bridge.counters["reconnects"] == 1)
    assert "bug in a parser" in bridge.last_error
    assert until(lambda: board.transport.connected and board.transport.write(b"fine")) and until(
        lambda: heard[-1:] == [b"fine"]
    )
    bridge.close()
