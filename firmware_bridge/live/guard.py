"""Who may see the page and press its buttons.

A browser shows pages of strangers beside ours. They can send requests here (cross-site), also under
a name of their own that suddenly leads to this computer (DNS rebinding). The names by which the
page is called, the origin of what is sent, and a token keep them out. The token stands behind the
link's #, which no browser sends or notes in a log; our script takes it from there and shows it in a
header of its own.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from email.message import Message
from http import HTTPStatus

FIRST, LAST = 0.2, 5.0
"""A second action counts from so long after the first one on, and until so long after it [s]."""
OWN_HEADER = "X-Kmpc"
"""Holds the token. No page of another site can send it without asking first, and nobody answers who
asks."""


class Refused(Exception):
    """What came is no request that is served."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


class Guard:
    """Lets through what a person at our own page asks for.

    `token`: behind the # of a link. `is_open`: whether one may watch and stop without it. `names`:
    hosts by which the page is called, besides addresses of numbers.
    """

    def __init__(self, token: str, is_open: bool, names: Sequence[str]) -> None:
        self._token, self._is_open, self._names = token.encode(), is_open, frozenset(names)

    def enter(
        self, method: str, headers: Mapping[str, str] | Message, public: bool = False
    ) -> bool:
        """Tell whether the token was shown.

        `method`: GET or POST. `headers`: of the request. `public`: whether anybody may have it: our
        own script, which then shows the token. Raises Refused for a foreign host or origin, and
        without a token where one is needed.
        """
        host = headers.get("Host", "")
        if not self._is_ours(host):
            raise Refused(HTTPStatus.FORBIDDEN, "this page is not called by that name")
        shown = headers.get(OWN_HEADER, "").encode("utf-8", "replace")
        known = hmac.compare_digest(shown, self._token)
        if not (known or self._is_open or public):
            raise Refused(HTTPStatus.FORBIDDEN, "open the link with the token that was printed")
        # a program that is no browser tells no origin
        origin, site = headers.get("Origin"), headers.get("Sec-Fetch-Site", "same-origin")
        foreign = origin not in (None, f"http://{host}") or site not in ("same-origin", "none")
        if foreign and (method != "GET" or origin is not None):
            raise Refused(HTTPStatus.FORBIDDEN, "another site's page may not ask for that")
        return known

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this computer.

        A name of a stranger's could lead here; an address of numbers is what it is.
        """
        name = host.lower()
        if name.startswith("["):
            name = name[1:].partition("]")[0]
        else:
            name = name.rpartition(":")[0] if ":" in name else name
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        return True


class TwoActions:
    """A second, deliberate action within a few seconds of the first.

    `clock`: monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._code, self._since = "", 0.0

    def first(self) -> str:
        """Take the first action; gives a code that the second one must show."""
        self._code, self._since = secrets.token_hex(8), self._clock()
        return self._code

    def second(self, code: object) -> bool:
        """Take the second action; a code counts once."""
        wanted, self._code = self._code, ""
        if not wanted or not isinstance(code, str):
            return False
        in_time = FIRST <= self._clock() - self._since <= LAST
        return in_time and hmac.compare_digest(code.encode("utf-8", "replace"), wanted.encode())
