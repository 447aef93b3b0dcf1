"""A flood on a link: small slices, a bounded share of the processor, and commands that leave."""

import os
import socket
import threading
import time

from firmware_bridge.link.ration import BURST, BYTES, SHARE, Ration
from firmware_bridge.link.sockets import DATAGRAM_BYTES, READ_BYTES, TcpPort, UdpEndpoint, UdpPort
from firmware_bridge.link.threaded import Endpoint, ThreadedTransport


def test_work_never_exceeds_its_share_and_a_stutter_costs_nothing():
    now, spent, ration = [100.0], [0.0], None
    ration = Ration(lambda: now[0], lambda: spent[0])
    for slice_ in range(2000):
        ration.begin()
        took = (0.001, 0.004, 0.0002)[slice_ % 3]
        spent[0] += took
        now[0] += took + (0.2 if slice_ % 100 == 0 else 0.0)  # the machine was busy elsewhere
        ration.end(1000)
        rest = ration.rest()
        assert rest <= 0.004 / SHARE + 1e-9
        now[0] += rest
        assert spent[0] <= SHARE * (now[0] - 100.0) + BURST + 0.005
    ration.begin()
    ration.end(0)
    assert ration.rest() == 0.0


def test_bytes_that_cost_no_work_are_bounded_too():
    """Noise that is soon thrown away came at 50 MB/s, into the record of the link as well."""
    now, size = [100.0], 0
    ration = Ration(lambda: now[0], lambda: 0.0)
    for _ in range(5000):
        ration.begin()
        ration.end(READ_BYTES)
        size += READ_BYTES
        now[0] += ration.rest() + 1e-6
    assert size <= BYTES * (now[0] - 100.0) + BYTES * BURST / SHARE + READ_BYTES


class Pair(Endpoint):
    """The near end of a socket pair."""

    def __init__(self, sock):
        self._sock = sock

    def open(self):
        sock, self._sock = self._sock, None
        sock.setblocking(False)
        return StreamPort(sock)


class StreamPort(TcpPort):
    """As TCP, without its options."""

    def __init__(self, sock):
        self._socket = sock


def test_a_flood_comes_in_small_slices_and_commands_leave_between():
    near, far = socket.socketpair()
    transport, sizes, done = ThreadedTransport(Pair(near)), [], threading.Event()
    spent = [0.0]
    transport._ration = Ration(work=lambda: spent[0])

    def slowly(data, stamp):
        sizes.append(len(data))
        spent[0] += 0.05  # as if each took so long

    transport.start(slowly)

    def flood():
        far.settimeout(0.05)
        while not done.is_set():
            try:
                far.send(b"\xfe" * 65536)
            except OSError:
                continue

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        began = time.monotonic()
        while len(sizes) < 3:
            time.sleep(0.005)
        assert transport.write(b"stop")
        far.settimeout(10.0)
        assert far.recv(16) == b"stop"
        elapsed = time.monotonic() - began
        assert max(sizes) <= READ_BYTES
        assert len(sizes) <= 2 + (SHARE * (elapsed + 0.2) + BURST) / 0.05
    finally:
        done.set()
        thread.join()
        transport.close()
        far.close()


def test_a_datagram_of_any_length_is_a_small_slice():
    port = UdpEndpoint("127.0.0.1", 0, listen=True).open()
    assert isinstance(port, UdpPort)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(os.urandom(60000), port._socket.getsockname())
        time.sleep(0.01)
        assert len(port.read()) <= DATAGRAM_BYTES
    port.close()
