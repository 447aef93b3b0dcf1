"""Where a page is served, and the links under which a person opens it."""

from __future__ import annotations

import ipaddress
import secrets
import socket
from dataclasses import dataclass, field

from kmpc_lite.errors import KmpcError

LOOPBACK = "127.0.0.1"
PORT = 8764  # of the page, unless another is given
LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Of a token: none that is taken for another one when it is typed on a phone."""
TOKEN_LENGTH = 12  # 59 bits: a guess a millisecond takes a million years
BACKLOG = 64
NOBODY = ("192.0.2.1", 9)
"""An address to which nothing is sent: asked by which interface it would be reached."""


class LiveError(KmpcError):
    """The page cannot be served."""


def new_token() -> str:
    """Make an unguessable token."""
    return "".join(secrets.choice(LETTERS) for _ in range(TOKEN_LENGTH))


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches a host.

    Examples
    --------
    >>> is_loopback("127.0.0.1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True)
class LiveAddress:
    """Host, port and token of a page."""

    host: str = LOOPBACK
    port: int = PORT
    token: str = field(default_factory=new_token)
    """Behind the link's #; whoever has it may let the robot drive again."""

    @property
    def is_open(self) -> bool:
        """Whether one may watch and stop without the token: on this computer only."""
        return is_loopback(self.host)

    def bind(self) -> list[socket.socket]:
        """Listen there.

        Raises LiveError: names the option that is wrong.
        """
        try:
            found = socket.getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise LiveError(f"--live-host {self.host}: {why}") from error
        family, _, _, _, place = found[0]
        try:
            return [socket.create_server(place[:2], family=family, backlog=BACKLOG)]
        except OSError as error:
            raise LiveError(
                f"--live-port {self.port}: cannot listen at {self.host}: "
                f"{error.strerror or error}: another page? give another --live-port or --live-host"
            ) from error

    def names(self) -> list[str]:
        """Hosts by which a browser may call this page; any address of numbers is one, too."""
        own = socket.gethostname().lower()
        return ["localhost", self.host.lower(), own, f"{own.partition('.')[0]}.local"]

    def links(self, port: int) -> list[str]:
        """Links to open, the one with the token last; `port` is the one that was bound."""
        host = self.host
        if host in ("0.0.0.0", "::"):
            host = _outward(host) or socket.gethostname()
        shown = f"[{host}]" if ":" in host else host
        return [f"http://{shown}:{port}/#{self.token}"]


def _outward(host: str) -> str:
    """Address of this computer towards others; empty if there is no network."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    target = ("2001:db8::1", 9) if family == socket.AF_INET6 else NOBODY
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(target)
            return str(probe.getsockname()[0])
        except OSError:
            return ""
