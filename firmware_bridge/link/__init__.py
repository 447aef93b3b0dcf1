"""Bytes in, bytes out: serial ports, pseudo-terminals, TCP, UDP, and a loopback with faults."""

from __future__ import annotations

from dataclasses import fields

from firmware_bridge.link.faults import Faults
from firmware_bridge.link.loopback import LoopbackEnd, LoopbackWire, named_wire
from firmware_bridge.link.protocol import OnBytes, Transport
from firmware_bridge.link.ration import Ration
from firmware_bridge.link.sockets import TcpEndpoint, UdpEndpoint
from firmware_bridge.link.threaded import ThreadedTransport
from firmware_bridge.link.tty import SPEEDS, TtyEndpoint
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError

__all__ = [
    "Faults",
    "LoopbackEnd",
    "LoopbackWire",
    "OnBytes",
    "Transport",
    "loopback_wire",
    "open_transport",
]

DEFAULT_BAUD = 115200


def open_transport(url: str, ration: Ration | None = None) -> Transport:
    """Build the near end of a link; `start` opens it.

    Parameters
    ----------
    url : str
        ``serial:PATH?baud=115200`` (``&dtr=0`` for a line that must be off), ``pty:PATH`` (made by
        the emulator), ``tcp:HOST:PORT`` (connects), ``udp:HOST:PORT`` (sends there;
        ``?listen=1`` waits there for the vehicle to speak first),
        ``loopback:NAME?drop=0.1&seed=3`` (the fields of `Faults`).

    Raises
    ------
    ConfigError
        For anything else.
    """
    link = LinkUrl.parse(url)
    if link.kind in ("serial", "pty"):
        link.allow("baud", *(("dtr",) if link.kind == "serial" else ()))
        default = DEFAULT_BAUD if link.kind == "serial" else None
        baud = int(link.number("baud", 0.0, min(SPEEDS), max(SPEEDS))) or default
        dtr = bool(link.number("dtr", 0, 0, 1)) if "dtr" in link.options else None
        return ThreadedTransport(TtyEndpoint(link.path(), baud, link.kind == "serial", dtr))
    if link.kind == "tcp":
        link.allow()
        return ThreadedTransport(TcpEndpoint(*link.address()), ration=ration)
    if link.kind == "udp":
        link.allow("listen")
        return ThreadedTransport(
            UdpEndpoint(*link.address(), listen=bool(link.number("listen", 0, 0, 1))),
            ration=ration,
        )
    return loopback_wire(link).take(board=False)


def loopback_wire(link: LinkUrl) -> LoopbackWire:
    """Find the wire of a loopback URL, with the faults that the URL asks for."""
    names = [entry.name for entry in fields(Faults)]
    link.allow(*names, "seed")
    if not link.target:
        raise ConfigError(f"link {link.text!r}: expected loopback:NAME")
    asked = {name: link.number(name, 0.0, 0.0, 3600.0) for name in names if name in link.options}
    return named_wire(
        link.target, Faults(**asked) if asked else None, int(link.number("seed", 0, 0, 2**31))
    )
