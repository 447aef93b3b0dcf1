"""TCP and UDP ports."""

from __future__ import annotations

import socket
import time

from firmware_bridge.link.threaded import Endpoint, Port
from firmware_bridge.messages import LinkError

CONNECT_TIMEOUT = 1.0
READ_BYTES, DATAGRAM_BYTES = 1024, 2048
"""Read at once: little, so that whoever takes it in is soon done. Longer datagrams are cut."""
RECEIVE_BUFFER = 65536  # what waits unread is old: no more than this of it [bytes]
SEND_BUFFER = 8192  # small, so that a peer that stalls cannot pile up old commands [bytes]
PEER_SILENCE = 1.0  # a listener takes another UDP peer once the first has been silent this long [s]


class TcpPort:
    """One connected stream."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket = sock

    def fileno(self) -> int:
        """Descriptor to poll."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """Take what has arrived."""
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise LinkError("the other end closed the connection")
        return data

    def write(self, data: memoryview) -> int:
        """Bytes that the socket took."""
        try:
            return self._socket.send(data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpEndpoint(Endpoint):
    """Connects to a listener, again whenever the connection is lost."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)

    def open(self) -> Port:
        """Connect."""
        try:
            return TcpPort(socket.create_connection(self._address, timeout=CONNECT_TIMEOUT))
        except TimeoutError:
            why = f"no answer within {CONNECT_TIMEOUT:g} s: is the address right?"
        except ConnectionRefusedError:
            why = "nothing listens there: is the vehicle or emulator running?"
        except OSError as error:
            why = error.strerror or str(error)
        raise LinkError(f"tcp:{self._address[0]}:{self._address[1]}: {why}")


class UdpPort:
    """A datagram socket with one peer: named from the start, or the first that speaks.

    A peer that has fallen silent may come back by another port, as a program that was started
    again does; another host is never taken for it.
    """

    def __init__(self, sock: socket.socket, connected: bool, host: str | None = None) -> None:
        sock.setblocking(False)
        self._socket, self._connected = sock, connected
        self._peer: tuple[str, int] | None = None
        self._heard = -float("inf")
        self.host = host  # the peer's, once it has spoken, or as it was known before
        self.refused = 0  # datagrams from others than the peer

    def fileno(self) -> int:
        """Descriptor to poll."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """One datagram."""
        try:
            data, sender = self._socket.recvfrom(DATAGRAM_BYTES)
        except (BlockingIOError, ConnectionRefusedError):
            return b""  # refused: a datagram sent before found nobody, and is lost
        if self._connected:
            return data
        now = time.monotonic()
        stranger = self.host not in (None, sender[0])
        if stranger or (sender != self._peer and now - self._heard < PEER_SILENCE):
            self.refused += 1
            return b""
        self._peer, self._heard, self.host = sender, now, sender[0]
        return data

    def write(self, data: memoryview) -> int:
        """Send one datagram; it is lost if there is no peer yet or its buffer is full."""
        try:
            if self._connected:
                self._socket.send(data)
            elif self._peer is not None:
                self._socket.sendto(data, self._peer)
        except (BlockingIOError, ConnectionRefusedError):
            pass  # as above
        return len(data)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class UdpEndpoint(Endpoint):
    """Sends to an address, or listens there and answers whoever spoke first."""

    def __init__(self, host: str, port: int, listen: bool = False) -> None:
        self._address, self._listen = (host, port), listen
        self._opened: UdpPort | None = None

    @property
    def refused(self) -> int:
        """Datagrams from others than the peer."""
        return 0 if self._opened is None else self._opened.refused

    def open(self) -> Port:
        """Make the socket."""
        host, port = self._address
        sock: socket.socket | None = None
        try:
            family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            sock = socket.socket(family, kind)
            (sock.bind if self._listen else sock.connect)(address)
        except OSError as error:
            if sock is not None:
                sock.close()
            hint = ": another program has the port" if self._listen else ""
            raise LinkError(f"udp:{host}:{port}: {error.strerror or error}{hint}") from error
        known = None if self._opened is None else self._opened.host
        self._opened = UdpPort(sock, not self._listen, known)
        return self._opened
