"""The far end of a link: a pseudo-terminal, a TCP or a UDP port."""

from __future__ import annotations

import os
import socket
import termios
import tty

from firmware_bridge.link import Transport
from firmware_bridge.link.sockets import TcpPort, UdpEndpoint
from firmware_bridge.link.threaded import Endpoint, Port, ThreadedTransport
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError, LinkError

READ_BYTES = 65536


class PtyPort:
    """The master side of a pseudo-terminal whose slave side is linked to a path.

    It holds the slave open as well, so that a bridge that leaves is no hang-up. What nobody reads
    is lost, as on a wire.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._master, self._slave = os.openpty()
        try:
            os.set_blocking(self._master, False)
            tty.setraw(self._slave)  # at once, before the terminal echoes the first byte
            self._name = os.ttyname(self._slave)
            ours = os.path.realpath(path) == self._name  # who was killed had the same terminal
            if os.path.islink(path) and (ours or not os.path.exists(path)):
                os.unlink(path)
            os.symlink(self._name, path)
        except OSError as error:
            os.close(self._master)
            os.close(self._slave)
            there = isinstance(error, FileExistsError)
            hint = ": another emulator or file is there; if it was killed, remove it" * there
            raise LinkError(f"pty:{path}: {error.strerror}{hint}") from error

    def fileno(self) -> int:
        """Descriptor to poll."""
        return self._master

    @property
    def speed(self) -> int:
        """The other side's output speed as a termios constant."""
        return int(termios.tcgetattr(self._slave)[5])

    def read(self) -> bytes:
        """Take what has arrived."""
        try:
            return os.read(self._master, READ_BYTES)
        except BlockingIOError:
            return b""

    def write(self, data: memoryview) -> int:
        """Bytes that the terminal took; all of them without a reader."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return len(data)

    def close(self) -> None:
        """Hang up and remove the link."""
        if os.path.islink(self._path) and os.readlink(self._path) == self._name:
            os.unlink(self._path)
        os.close(self._master)
        os.close(self._slave)


class PtyEndpoint(Endpoint):
    """Makes the pseudo-terminal once."""

    def __init__(self, path: str) -> None:
        self._path = path
        self.port: PtyPort | None = None

    def open(self) -> Port:
        """Make it."""
        self.port = PtyPort(self._path)
        return self.port


class TcpListener(Endpoint):
    """Listens for one client at a time; others are sent away."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self.turned_away = 0

    @property
    def port(self) -> int:
        """Port it listens at, once open: the system's choice where 0 was asked for."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    def open(self) -> Port | None:
        """Listen at first, then take the next client."""
        if self._socket is None:
            host, port = self._address
            try:
                family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
                self._socket = socket.create_server(self._address, family=family, backlog=4)
            except OSError as error:
                why = error.strerror or str(error)
                raise LinkError(f"tcp:{host}:{port}: cannot listen: {why}") from error
            self._socket.setblocking(False)
            return None
        try:
            return TcpPort(self._socket.accept()[0])
        except BlockingIOError:
            return None

    def fileno(self) -> int | None:
        """Descriptor that becomes readable when a client comes."""
        return None if self._socket is None else self._socket.fileno()

    def turn_away(self) -> None:
        """Close the connection of a second client."""
        assert self._socket is not None
        try:
            self._socket.accept()[0].close()
        except BlockingIOError:
            return
        self.turned_away += 1

    def close(self) -> None:
        """Stop listening."""
        if self._socket is not None:
            self._socket.close()


def line_speed(transport: Transport) -> int | None:
    """Bits per second that the bridge has set on a pseudo-terminal.

    None for other links, and for speeds that no port here has.
    """
    endpoint = transport.endpoint if isinstance(transport, ThreadedTransport) else None
    if not isinstance(endpoint, PtyEndpoint) or endpoint.port is None:
        return None
    from serial import Serial  # here, for other links go without pyserial

    rates = {number: rate for rate, number in Serial.BAUDRATE_CONSTANTS.items()}
    return rates.get(endpoint.port.speed)


def serve(url: str) -> Transport:
    """Build the far end of a link, for the same URL that the bridge opens; `start` makes the port.

    Raises
    ------
    ConfigError
        For a URL that cannot be served: a serial port is served by the board itself.
    """
    link = LinkUrl.parse(url)
    if link.kind == "serial":
        raise ConfigError(f"link {url!r}: an emulator serves pty:, tcp: or udp:")
    link.allow(*{"pty": ("baud",), "tcp": (), "udp": ("listen",)}[link.kind])
    if link.kind == "pty":
        return ThreadedTransport(PtyEndpoint(link.path()))
    if link.kind == "tcp":
        return ThreadedTransport(TcpListener(*link.address()))
    return ThreadedTransport(UdpEndpoint(*link.address(), listen=True))
