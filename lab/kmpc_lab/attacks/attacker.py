"""A hostile process, as fast as this machine lets it be: it stands in the way, or beside it.

``python -m kmpc_lab.attacks.attacker KIND ADDRESS... FILE``. It says "ready", attacks from a
line on its standard input on, and ends with that input.
"""

from __future__ import annotations

import os
import select
import socket
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

HOST = "127.0.0.1"
PENDING = 65536
"""Of a flood, waiting for the other end [bytes]."""
AT_ONCE = 50
"""Datagrams, or connections, between two looks at everything else."""
DATAGRAM = 1400
IDLE = 9
BROWSERS = 300
"""Connections that are held to a page."""


class Orders:
    """What standard input says."""

    def __init__(self) -> None:
        self.attacking, self.over = False, False

    def look(self, others: list[socket.socket], timeout: float) -> list[socket.socket]:
        """Wait for orders or for others; gives those of the others that have something."""
        ready = select.select([sys.stdin, *others], [], [], timeout)[0]
        if sys.stdin in ready:
            line = os.read(sys.stdin.fileno(), 64)
            self.attacking, self.over = bool(line), not line
        return [other for other in others if other in ready]


def stand_between_tcp(listen: str, target: str, rubbish: bytes) -> None:
    """Pass bytes on both ways, and flood the other end."""
    server = socket.create_server((HOST, int(listen)))
    _ready()
    near, _ = server.accept()
    far = socket.create_connection((HOST, int(target)))
    near.setblocking(False)
    orders, pending = Orders(), b""
    while not orders.over:
        busy = bool(pending) or orders.attacking
        for source in orders.look([near, far], 0.0 if busy else 0.5):
            try:
                data = source.recv(65536)
            except ConnectionResetError:
                data = b""
            if not data:
                return
            if source is near:
                far.sendall(data)
            else:
                pending += data
        if orders.attacking and len(pending) < PENDING:
            pending += rubbish
        if pending and select.select([], [near], [], 0.002)[1]:
            try:
                pending = pending[near.send(pending[:PENDING]) :]
            except OSError:  # it has left
                return


def stand_between_udp(listen: str, target: str, rubbish: bytes, towards: str = "peer") -> None:
    """Pass datagrams on both ways, and flood the end that has spoken first, or the target."""
    near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    near.bind((HOST, int(listen)))
    far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    far.connect((HOST, int(target)))
    _ready()
    orders, peer, at = Orders(), None, 0
    pieces = [rubbish[i : i + DATAGRAM] for i in range(0, len(rubbish), DATAGRAM)]
    while not orders.over:
        for source in orders.look([near, far], 0.0 if orders.attacking else 0.5):
            try:
                data, sender = source.recvfrom(65536)
                if source is near:
                    peer = sender
                    far.send(data)
                elif peer is not None:
                    near.sendto(data, peer)
            except ConnectionRefusedError:  # nobody is there yet
                continue
        for _ in range(AT_ONCE if orders.attacking else 0):
            at += 1
            try:
                if towards == "target":
                    far.send(pieces[at % len(pieces)])
                elif peer is not None:
                    near.sendto(pieces[at % len(pieces)], peer)
            except OSError:
                break


def stand_between_poses(listen: str, target: str, rubbish: bytes) -> None:
    """Pass poses on, and flood their reader under the same sender."""
    stand_between_udp(listen, target, rubbish, "target")


def send_beside(target: str, rubbish: bytes) -> None:
    """Flood a port as a stranger."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.connect((HOST, int(target)))
    _ready()
    orders = Orders()
    while not orders.over:
        orders.look([], 0.0 if orders.attacking else 0.5)
        for _ in range(AT_ONCE if orders.attacking else 0):
            try:
                sock.send(rubbish[:DATAGRAM])
            except OSError:
                break


def hog(path: str, rubbish: bytes) -> None:
    """Connect to a local socket without end, and say half a word."""
    _ready()
    orders = Orders()
    while not orders.over:
        orders.look([], 0.0 if orders.attacking else 0.5)
        for _ in range(AT_ONCE if orders.attacking else 0):
            with socket.socket(socket.AF_UNIX) as sock:
                sock.setblocking(False)
                try:
                    sock.connect(path)
                    sock.send(b"st")
                except OSError:
                    continue


def idle(path: str, rubbish: bytes) -> None:
    """Hold connections that say nothing, and one that trickles; again when they are closed."""
    _ready()
    orders = Orders()
    held: list[socket.socket] = []
    while not orders.over:
        orders.look([], 0.05 if orders.attacking else 0.5)
        if not orders.attacking:
            continue
        for sock in held:
            sock.close()
        held = [socket.socket(socket.AF_UNIX) for _ in range(IDLE + 1)]
        for sock in held:
            sock.settimeout(0.5)
            try:
                sock.connect(path)
            except OSError:
                continue
        for letter in (b"s", b"t", b"o"):
            try:
                held[0].send(letter)
            except OSError:
                break
            time.sleep(0.15)


def press(path: str, rubbish: bytes) -> None:
    """Press the emergency stop on request, and say when that was [s], on the monotonic clock."""
    from firmware_bridge.messages import LinkError
    from firmware_bridge.safety import estop_client

    _ready()
    orders = Orders()
    while not (orders.attacking or orders.over):
        orders.look([], 1.0)
    if orders.attacking:
        _say(str(time.monotonic()))
        try:
            estop_client.press(Path(path), 1.0)
        except LinkError:  # it holds by its latch
            return


def browse_badly(port: str, rubbish: bytes) -> None:
    """Connect to a page without end: say noise, half a request, or watch and read nothing."""
    sayings = (
        rubbish[:DATAGRAM],
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1",
        b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: " + b"x" * DATAGRAM,
    )
    _ready()
    orders, held = Orders(), deque[socket.socket]()
    while not orders.over:
        orders.look([], 0.0 if orders.attacking else 0.5)
        for number in range(AT_ONCE if orders.attacking else 0):
            sock = socket.socket()
            sock.setblocking(False)
            held.append(sock)
            sock.connect_ex((HOST, int(port)))
            if len(held) > BROWSERS:
                held.popleft().close()
            try:  # a connection of a moment ago
                held[len(held) // 2].send(sayings[number % len(sayings)])
            except OSError:
                continue


def watch_page(link: str, count: str, rubbish: bytes) -> None:
    """Watch a page with so many browsers from "on" to "off"; the first of them reads nothing."""
    from urllib.parse import urlsplit

    url = urlsplit(link)
    ask = f"GET {url.path}events HTTP/1.1\r\nHost: {url.netloc}\r\n\r\n".encode()
    _ready()
    watching: list[socket.socket] = []
    while True:
        ready = select.select([sys.stdin, *watching[1:]], [], [], 1.0)[0]
        if sys.stdin in ready:
            word = os.read(sys.stdin.fileno(), 64).decode().strip()
            for sock in watching:
                sock.close()
            watching = []
            if not word:
                return
            for _ in range(int(count) if word.endswith("on") else 0):
                watching.append(socket.create_connection((HOST, int(url.port or 0))))
                watching[-1].sendall(ask)
            continue
        for sock in [sock for sock in watching if sock in ready]:
            if not sock.recv(65536):
                watching.remove(sock)


def press_page(link: str, rubbish: bytes) -> None:
    """Press STOP as a page does: on the line that it keeps, again until it is confirmed.

    Says when that began [s].
    """
    from kmpc_lab.attacks.finger import PageLine

    _ready()
    orders, page = Orders(), PageLine(link)
    while not (orders.attacking or orders.over):
        page.keep()
        orders.look([], 1.0)
    if not orders.attacking:
        return
    _say(str(time.monotonic()))
    page.stop()


KINDS: dict[str, Callable[..., None]] = {
    "tcp": stand_between_tcp,
    "lidar": stand_between_tcp,
    "udp": stand_between_udp,
    "poses": stand_between_poses,
    "beside": send_beside,
    "hog": hog,
    "idle": idle,
    "press": press,
    "browsers": browse_badly,
    "station": send_beside,
    "watchers": watch_page,
    "press_page": press_page,
}


def _ready() -> None:
    _say("ready")


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    KINDS[sys.argv[1]](*sys.argv[2:-1], Path(sys.argv[-1]).read_bytes())
