"""Bytes in, bytes out: serial ports, pseudo-terminals, TCP and UDP."""

from __future__ import annotations

from firmware_bridge.link.sockets import TcpEndpoint, UdpEndpoint
from firmware_bridge.link.threaded import OnBytes, Ration, ThreadedTransport, Transport
from firmware_bridge.link.url import LinkUrl

__all__ = ["OnBytes", "Transport", "open_transport"]
DEFAULT_BAUD = 115200


def open_transport(url: str, ration: Ration | None = None) -> Transport:
    """Build the near end of a link; `start` opens it.

    Parameters
    ----------
    url : str
        ``serial:PATH?baud=115200`` (``&dtr=0`` for a line that must be off), ``pty:PATH`` (made by
        the emulator), ``tcp:HOST:PORT`` (connects), ``udp:HOST:PORT`` (sends there;
        ``?listen=1`` waits there for the vehicle to speak first).

    Raises
    ------
    ConfigError
        For anything else.
    """
    link = LinkUrl.parse(url)
    if link.kind in ("serial", "pty"):
        # here, for other links go without pyserial
        from firmware_bridge.link.serial_port import FASTEST, OF_A_TERMINAL, SLOWEST, SerialEndpoint

        link.allow("baud", *(("dtr",) if link.kind == "serial" else ()))
        default = DEFAULT_BAUD if link.kind == "serial" else OF_A_TERMINAL
        baud = int(link.number("baud", default, SLOWEST, FASTEST))
        dtr = bool(link.number("dtr", 0, 0, 1)) if "dtr" in link.options else None
        return ThreadedTransport(SerialEndpoint(link.path(), baud, link.kind == "serial", dtr))
    if link.kind == "tcp":
        link.allow()
        return ThreadedTransport(TcpEndpoint(*link.address()), ration)
    link.allow("listen")
    listen = bool(link.number("listen", 0, 0, 1))
    return ThreadedTransport(UdpEndpoint(*link.address(), listen), ration)
