"""A flood on a link: small slices, a bounded share of the processor, and commands that leave."""

import socket
import threading
import time

from firmware_bridge.link.ration import BURST, SHARE, Ration
from firmware_bridge.link.sockets import READ_BYTES, TcpPort
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
