"""The connection that a page keeps for its STOP."""

from __future__ import annotations

import time
from http.client import HTTPConnection, HTTPException
from urllib.parse import urlsplit

HOST = "127.0.0.1"
PATIENCE = 3.0
"""For each answer [s]."""
TRIES, PAUSE = 20, 0.05
"""How often STOP is pressed at most, and the time in between [s]."""


class PageLine:
    """Posts what a page posts, on one connection for as long as that lives.

    Parameters
    ----------
    link : str
        Of the page, with its key.
    """

    def __init__(self, link: str) -> None:
        url = urlsplit(link)
        self._path = url.path
        self._connection = HTTPConnection(HOST, int(url.port or 0), timeout=PATIENCE)

    def post(self, word: str) -> bytes:
        """Give the answer to a word, empty where none came."""
        try:
            self._connection.request("POST", f"{self._path}{word}")
            return self._connection.getresponse().read()
        except (OSError, HTTPException):
            self._connection.close()  # the next one opens another
            return b""

    def keep(self) -> None:
        """Keep the connection open, as a page does that nobody presses."""
        self.post("line")

    def stop(self) -> bool:
        """Press STOP until the bridge has confirmed it, as a page does; False: it never did."""
        for _ in range(TRIES):
            if b'"confirmed": true' in self.post("stop"):
                return True
            time.sleep(PAUSE)
        return False
